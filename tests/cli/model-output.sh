# SPDX-License-Identifier: Apache-2.0
# -o out.glb and out.gltf: the target with its new textures. Names, refusals, several targets; the bytes are
# looked at in unit_io_models.
source "$(dirname "$0")/support.sh"
make_job

# model NAME MATERIAL...: a unit square per material, side by side, as a .gltf with its buffer as NAME.bin.
model() {
  local name=$1 primitives='' materials='' material count=0
  shift
  # Positions, UVs (both as floats, little-endian) and indices of one square.
  {
    printf '\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0'
    printf '\0\0\0\0\0\0\x80\x3f\0\0\x80\x3f\0\0\x80\x3f\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\0\0'
    printf '\0\0\1\0\2\0\0\0\2\0\3\0'
  } >"$name.bin"
  for material in "$@"; do
    primitives+="${primitives:+,}{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"indices\":2,\"material\":$count}"
    materials+="${materials:+,}{\"name\":\"$material\",\"extras\":{\"wear\":0.10}}"
    count=$((count + 1))
  done
  cat >"$name.gltf" <<END
{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"name":"n"}],
"meshes":[{"primitives":[$primitives]}],"materials":[$materials],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":32},{"buffer":0,"byteOffset":80,"byteLength":12}],
"buffers":[{"uri":"$name.bin","byteLength":92}]}
END
}

model one skin
model two skin eyes/lashes
inputs=$(ls | wc -l)

# One file, whose texture gives the source's colour back.
expect 0 transfer source.obj one.gltf -o out.glb
err_has 'wrote out.glb'
[[ $(ls | wc -l) == $((inputs + 1)) ]] || fail "more than one file: $(ls)"
grep -qa '"extras":{"wear":0.10}' out.glb || fail 'the spelling of a number has changed'
expect 0 transfer out.glb target.obj -o back.png -q
expect 0 compare back.png skin.ppm --min-psnr 50
# The same bytes from a warm cache, without one, and with one thread.
expect 0 transfer source.obj one.gltf -o again.glb -q
expect 0 transfer source.obj one.gltf -o none.glb -q --no-cache --threads 1
cmp out.glb again.glb || fail 'a warm cache changes the model'
cmp out.glb none.glb || fail 'no cache changes the model'
rm -- *.glb back.png

# A .gltf: an image per material and channel, a name for each, listed before and after.
expect 0 transfer source.obj two.gltf -o out.gltf --plan
for name in out.gltf out.bin out.skin.baseColor.png out.eyes_lashes.baseColor.png; do
  out_has "$name"
  [[ ! -e $name ]] || fail "--plan wrote $name"
done
expect 0 transfer source.obj two.gltf -o out.gltf --report report.json --coverage 'mask.<MATERIAL>.png'
for name in out.gltf out.bin out.skin.baseColor.png out.eyes_lashes.baseColor.png mask.skin.png; do
  [[ -s $name ]] || fail "$name is not there"
  grep -qF "\"$name\"" report.json || fail "the report lacks $name"
done
cmp out.bin two.bin || fail 'the buffer has changed'
expect 0 compare out.skin.baseColor.png skin.ppm --min-psnr 50
rm -- out* mask* report.json

# Several targets.
expect 0 transfer source.obj one.gltf two.gltf -o '<TARGET>.new.glb' -q
[[ -s one.new.glb && -s two.new.glb ]] || fail 'a target is missing'
rm -- *.glb

# A job that fails leaves nothing.
expect 2 transfer source.obj target.obj -o out.glb
err_has 'target.obj is neither'
expect 2 transfer source.obj one.gltf -o one.gltf
err_has 'is also an input'
cp one.bin taken.bin
sed 's/one\.bin/taken.bin/' one.gltf >uses-taken.gltf
expect 2 transfer source.obj uses-taken.gltf -o taken.gltf
err_has 'taken.bin: is also an input'
rm taken.bin uses-taken.gltf
expect 2 transfer source.obj one.gltf -o out.glb --depth half
err_has 'which supports u8 and u16'
expect 2 transfer source.obj one.gltf -o 'out.<CHANNEL>.glb'
err_has '<TARGET>'
expect 2 transfer source.obj one.gltf -o out.glb --coverage mask.glb
[[ $(ls | wc -l) == "$inputs" ]] || fail "files were made: $(ls)"

# --skip-existing looks at every file of a model, and at all that it is made of.
sed 's/"materials":\[/"images":[{"uri":"own.png"}],"textures":[{"source":0}],"materials":[{"name":"unseen","occlusionTexture":{"index":0}},/; s/"material":0/"material":1/' \
  one.gltf >own.gltf
expect 0 transfer source.obj target.obj -o own.png --size 4 -q
touch -d '2020-01-01' -- *
keeps=(transfer source.obj own.gltf -o out.glb --coverage mask.png --skip-existing)
expect 0 "${keeps[@]}"
expect 0 "${keeps[@]}"
err_has 'skipped 2 '
rm mask.png
expect 0 "${keeps[@]}"
[[ -s mask.png ]] || fail 'the mask was not made again'
touch own.png # an image of the target that the model takes in, and that is the same
expect 0 "${keeps[@]}"
err_has 'skipped 2 '
expect 0 transfer source.obj target.obj -o own.png --size 5 -q
touch -d '2020-01-01' own.png
expect 0 "${keeps[@]}"
err_has 'wrote out.glb'
expect 0 "${keeps[@]}" --max-angle 70
err_has 'wrote out.glb'
