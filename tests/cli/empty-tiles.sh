# SPDX-License-Identifier: Apache-2.0
# Tiles that found nothing are named with their material, each once and in order, also where the first channel was kept.
source "$(dirname "$0")/support.sh"
image skin.ppm 16 16 200 100 50
image glow.ppm 8 8 9 9 9
quad source skin.ppm
echo 'map_Ke glow.ppm' >>source.mtl
# square MATERIAL COLUMN Z: in a tile of UV space; what lies at 100 finds nothing.
squares=0
square() {
  local v=$((4 * squares))
  squares=$((squares + 1))
  printf 'usemtl %s\nv 0 0 %d\nv 1 0 %d\nv 1 1 %d\nv 0 1 %d\nvt %d 0\nvt %d.9 0\nvt %d.9 0.9\nvt %d 0.9\n' \
    "$1" "$3" "$3" "$3" "$3" "$2" "$2" "$2" "$2"
  printf 'f %d/%d %d/%d %d/%d %d/%d\n' $((v + 1)) $((v + 1)) $((v + 2)) $((v + 2)) $((v + 3)) $((v + 3)) \
    $((v + 4)) $((v + 4))
}
{ square left 0 0; square left 2 100; square right 2 100; square right 1 100; square right 3 0; } >target.obj
touch -d '2020-01-01' ./*.obj ./*.mtl ./*.ppm
said() {
  err_has 'no texel of UDIM 1003 of material "left" found a source'
  err_has 'no texel of UDIM 1002, 1003 of material "right" found a source'
}
job=(transfer source.obj target.obj -o 'o.<MATERIAL>.<CHANNEL>.<UDIM>.png' --max-distance 1 --skip-existing --no-cache)
expect 0 "${job[@]}"
said
rm -- *.emissive.*
for name in left.baseColor.1003 right.baseColor.1002 right.baseColor.1003; do cp o.left.baseColor.1001.png o.$name.png; done
expect 0 "${job[@]}" # baseColor stays
said
expect 0 transfer source.obj target.obj -o 'p.<UDIM>.png' --max-distance 1 --no-cache
err_has 'no texel of UDIM 1002, 1003 found a source; no image was written'

# A page of which the first channel has no source is written for what the second found.
printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 1 0\nvt 2 0\nvt 2 1\nvt 1 1\n' >two.obj
printf 'f 1/1 2/2 3/3 4/4\nf 2/5 5/6 6/7 3/8\n' >>two.obj
image base.1001.ppm 8 8 9 99 9
for udim in 1001 1002; do image glow.$udim.ppm 8 8 9 9 99; done
expect 0 transfer two.obj two.obj -o 'q.<CHANNEL>.<UDIM>.png' --size 8 --no-cache \
  --source-texture 'baseColor=base.<UDIM>.ppm' --source-texture 'emissive=glow.<UDIM>.ppm'
[[ -e q.emissive.1002.png ]] || fail "what the second channel found is lost: $(ls)"
