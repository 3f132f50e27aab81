# SPDX-License-Identifier: Apache-2.0
# --keep-uvs makes a lighter model in the heavy one's layout: its UVs, its materials, nothing over anything else.
source "$(dirname "$0")/support.sh"
number() { tr -d ' \n' <"$1" | sed -nE "s/.*$2.*/\1/p"; }
psnr() { "$POUNCE" compare "$@" | sed -nE 's/^psnr +([0-9]+).*/\1/p'; }
materials_of() {
  expect 0 inspect "$1" --json
  grep -A1 '"materials"' "$out" >"$out.m"
  tr -d '\n' <"$out" | grep -o '"materials": *\[.*' | grep -oE '"name": *"[^"]*"' | sed -E 's/.*"([^"]*)"$/\1/' | paste -sd' '
}
"$POUNCE_FIXTURE" head -o h --triangles 20000 --texture 512 --target-size 512 >"$out"
heavy=h/head_src.glb
expect 0 proxy "$heavy" -o lod.glb --triangles 2000 --size 1024 --keep-uvs --report lod.json
err_has "in 1 material, with the UVs of $heavy"
expect 0 inspect lod.glb --json
triangles=$(number "$out" '"triangles":([0-9]+)')
((triangles > 1500 && triangles <= 2000)) || fail "$triangles triangles of 2000"
[[ $(materials_of lod.glb) == "$(materials_of "$heavy")" && -n $(materials_of lod.glb) ]] || fail "the materials are $(materials_of lod.glb)"
grep -q '"normalTexture"' lod.glb || fail 'no normal map'
[[ $(number lod.json '"overlapping":([0-9]+)') == 0 ]] || fail 'triangles lie on each other in the texture'
# Every UV of the light one is one of the heavy one's: the accessors of both files, as numbers.
uvs_of() {
  python3 - "$1" <<'PYTHON'
import json, struct, sys
data = open(sys.argv[1], 'rb').read()
length = struct.unpack_from('<I', data, 12)[0]
gltf, binary = json.loads(data[20:20 + length]), data[28 + length:]
for index in {p['attributes']['TEXCOORD_0'] for m in gltf['meshes'] for p in m['primitives']}:
    accessor = gltf['accessors'][index]
    view = gltf['bufferViews'][accessor['bufferView']]
    at, step = view.get('byteOffset', 0) + accessor.get('byteOffset', 0), view.get('byteStride', 8)
    for k in range(accessor['count']):
        print(binary[at + k * step:at + k * step + 8].hex())
PYTHON
}
if command -v python3 >/dev/null; then
  uvs_of "$heavy" | sort -u >heavy.uvs
  uvs_of lod.glb | sort -u >light.uvs
  [[ -s light.uvs && -z $(comm -13 heavy.uvs light.uvs) ]] || fail 'UVs that the heavy model has not'
fi
# A texture that was painted for the heavy model fits the light one's UVs, and the other way round.
expect 0 transfer lod.glb h/head_same.glb -o back.png --size 512
expect 0 transfer "$heavy" h/head_same.glb -o direct.png --size 512
((db = $(psnr back.png direct.png), db >= 40)) || fail "over the light model the head is $db dB from what the heavy one gives"
expect 0 transfer "$heavy" lod.glb -o light.png --size 512
expect 0 transfer "$heavy" "$heavy" -o own.png --size 512
((db = $(psnr light.png own.png), db >= 20)) || fail "the light model's texture is $db dB from the heavy one's"
# The same bytes from pounce mesh, with any number of threads.
expect 0 mesh "$heavy" -o same.glb --triangles 2000 --size 1024 --keep-uvs --threads 4
cmp lod.glb same.glb || fail 'mesh makes another model'
expect 0 proxy "$heavy" -o fine.glb --detail 0.1% --size 256 --keep-uvs
expect 0 proxy "$heavy" -o coarse.glb --detail 1% --size 256 --keep-uvs
triangles_of() {
  expect 0 inspect "$1" --json
  number "$out" '"triangles":([0-9]+)'
}
(($(triangles_of coarse.glb) * 2 < $(triangles_of fine.glb) && $(triangles_of fine.glb) < 20000)) || fail '--detail'
# Two materials, of one name each; triangles without UVs; tiles.
printf 'newmtl left\nmap_Kd a.png\nnewmtl right\nmap_Kd a.png\n' >two.mtl
cp own.png a.png
strip() { # N columns of squares, bent, in two materials; the right half with another V
  echo "mtllib $1.mtl"
  for ((x = 0; x <= 40; ++x)); do for y in 0 1 2; do printf 'v %d.0 %d.0 0.%d\nvt 0.%02d 0.%d\n' $x $y $((x * x % 7)) $((2 * x)) $((y * 4)); done; done
  for ((x = 0; x < 40; ++x)); do
    ((x != 0)) || echo 'usemtl left'
    ((x != 20)) || echo 'usemtl right'
    for y in 1 2; do
      a=$((3 * x + y)) b=$((3 * x + y + 3))
      echo "f $a/$a $b/$b $((b + 1))/$((b + 1)) $((a + 1))/$((a + 1))"
    done
  done
}
strip two >two.obj
expect 0 proxy two.obj -o two.glb --triangles 100 --size 128 --keep-uvs
err_has 'in 2 materials'
[[ $(materials_of two.glb) == 'left right' ]] || fail "two materials became $(materials_of two.glb)"
printf 'newmtl left\nmap_Kd t.<UDIM>.png\nnewmtl right\nmap_Kd a.png\n' >tiles.mtl
cp own.png t.1001.png
cp own.png t.1002.png
strip tiles | sed -E 's/^vt 0\.(..) /vt \1 /; s/^vt (.)(.) /vt \1.\2 /' | awk '/^vt/ { $2 = $2 / 2.2 } { print }' >tiles.obj
expect 0 proxy tiles.obj -o tiles.glb --triangles 100 --size 128 --keep-uvs
[[ $(materials_of tiles.glb) == 'left.1001 left.1002 right' ]] || fail "tiles became $(materials_of tiles.glb)"
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 2 4 3\n' >part.obj
expect 3 proxy part.obj -o n.glb --keep-uvs
err_has '1 of 2 triangles have no UVs'
# Without a texture nothing says that UVs repeat: tiles are told apart there too, unless a triangle crosses their border.
squares() { # N squares side by side, each in the texture moved by so much from the one before
  for ((x = 0; x < $1; ++x)); do
    awk -v x="$x" -v by="$2" -v scale="${3-1}" 'BEGIN { for (j = 0; j <= 4; ++j) for (i = 0; i <= 4; ++i) {
      printf "v %f %f %f\nvt %f %f\n", 1.5 * x + i / 4, j / 4, 0.05 * i * j % 3, x * by + scale * (0.1 + 0.2 * i), scale * (0.1 + 0.2 * j) } }'
    for j in 0 1 2 3; do
      for i in 1 2 3 4; do
        a=$((25 * x + 5 * j + i)) b=$((25 * x + 5 * j + i + 5))
        echo "f $a/$a $((a + 1))/$((a + 1)) $((b + 1))/$((b + 1)) $b/$b"
      done
    done
  done
}
squares 4 1 >plain.obj
expect 0 proxy plain.obj -o plain.glb --triangles 100 --size 128 --keep-uvs
[[ $(materials_of plain.glb) == 'default.1001 default.1002 default.1003 default.1004' ]] || fail "tiles without a texture became $(materials_of plain.glb)"
squares 4 0.4 >cross.obj
expect 0 proxy cross.obj -o cross.glb --triangles 100 --size 128 --keep-uvs
[[ $(materials_of cross.glb) == default ]] || fail "what repeats became $(materials_of cross.glb)"
# UVs that no texture can be made on.
squares 1 0 1e30 >far.obj
expect 3 proxy far.obj -o n.glb --triangles 100 --size 128 --keep-uvs
err_has 'far.obj: the UVs span too many texels (triangle 0) for --keep-uvs: rescale the UVs'
squares 1 0 0 >equal.obj
expect 0 proxy equal.obj -o equal.glb --triangles 100 --size 128 --keep-uvs
err_has 'equal.obj: no triangle of these materials has an area in its UVs'
err_has 'leave --keep-uvs out'
# Where it means nothing.
misused '--gutter' proxy "$heavy" -o n.glb --keep-uvs --gutter 2
"$POUNCE_FIXTURE" splats -o s.ply --shape sphere --count 4000 --target-size 64 >"$out"
misused '--keep-uvs applies only to meshes' proxy s.ply -o n.glb --keep-uvs
misused '--keep-uvs applies only to meshes' mesh s.ply -o n.glb --keep-uvs
[[ ! -e n.glb ]] || fail 'a file of a job that failed'
