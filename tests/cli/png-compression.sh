# SPDX-License-Identifier: Apache-2.0
# --png-compression: other bytes of the same picture, and another job; its default is none.
source "$(dirname "$0")/support.sh"
rejected --png-compression -1 10 1.5 best ''
refused '--png-compression applies only to PNG output, but o.tif is not' transfer a.glb b.glb -o o.tif --png-compression 9
"$POUNCE_FIXTURE" head -o head --triangles 2000 --texture 256 --target-size 64 >/dev/null
job=(transfer head/head_src.glb head/head_same.glb --size 256 --cache cache)
expect 0 "${job[@]}" -o usual.png
bytes() { wc -c <"$1"; }
for level in 0 2 9; do
  expect 0 "${job[@]}" -o "$level.png" --png-compression "$level"
  same_picture usual.png "$level.png" || fail "level $level is another picture"
done
cmp usual.png 2.png || fail 'the default is another job'
(($(bytes 9.png) < $(bytes 2.png) && $(bytes 2.png) < $(bytes 0.png))) || fail "sizes: $(wc -c ./*.png)"
expect 0 "${job[@]}" -o o.glb --png-compression 0
large=$(bytes o.glb)
expect 0 "${job[@]}" -o o.glb
((large > $(bytes o.glb))) || fail 'the images of a model have one level'
expect 0 "${job[@]}" -o 9.png --png-compression 9 --skip-existing --report r.json
grep -qF '"outputs": []' r.json || fail 'made again'
expect 0 "${job[@]}" -o 9.png --skip-existing --report r.json
grep -qF '"9.png"' r.json || fail 'a file of another level was kept'
