# SPDX-License-Identifier: Apache-2.0
# --map: a hit map beside the images, by UDIM tile too; what it cannot be; it is an output like the others.
source "$(dirname "$0")/support.sh"
# Where there can be none: refused before a file is read.
refused '--map m.png: a map has named float channels; write .exr' transfer a.glb b.glb -o o.png --map m.png
refused '<UDIM> must appear both in this pattern' transfer a.glb b.glb -o 'o.<UDIM>.png' --map m.exr
refused 'leave out <CHANNEL>' transfer a.glb b.glb -o o.png --map 'm.<CHANNEL>.exr'
refused 'o.glb is a model' transfer a.glb b.glb -o o.glb --map m.exr
refused '--onto' transfer a.glb b.glb -o o.png --map m.exr --onto old.png
refused '--map' transfer a.glb b.glb -o o.png --map m.exr --method gaussian
"$POUNCE_FIXTURE" plane -o p.obj --triangles 200 --texture 32 --uv-tiles 2 >"$out"
job=(transfer p.obj p.obj --source-texture 'baseColor=p.<UDIM>.png' --size 64)
expect 0 "${job[@]}" -o 'o.<UDIM>.png' --map 'm.<UDIM>.exr' --report r.json
grep -q '"m.1002.exr"' r.json || fail 'the report does not name the map'
grep -q '"channel": "hits"' r.json || fail 'the report does not name the channel'
expect 0 inspect m.1002.exr
out_has 'udim'
out_has 'angle'
# The pictures are those of a job without a map.
expect 0 "${job[@]}" -o 'p.<UDIM>.out.png' --no-cache
for tile in 1001 1002; do cmp "o.$tile.png" "p.$tile.out.png" || fail "a map changes tile $tile"; done
# What only its format has applies to it.
expect 0 "${job[@]}" -o 'o2.<UDIM>.png' --map 'm2.<UDIM>.exr' --exr-compression rle
[[ $(stat -c %s m2.1001.exr) -gt $(stat -c %s m.1001.exr) ]] || fail 'not compressed as asked'
# Up to date, it is skipped; without its map a job is not done.
expect 0 "${job[@]}" -o 'o.<UDIM>.png' --map 'm.<UDIM>.exr' --skip-existing --report r.json
grep -qF '"outputs": []' r.json || fail 'made again'
cp m.1002.exr kept.exr
rm m.1002.exr
expect 0 "${job[@]}" -o 'o.<UDIM>.png' --map 'm.<UDIM>.exr' --skip-existing --report r.json
cmp m.1002.exr kept.exr || fail 'another map'
[[ $(tr -d ' \n' <r.json) == *'"outputs":["m.1002.exr"]'* ]] || fail 'more than the map was made'
expect 0 "${job[@]}" -o 'o.<UDIM>.png' --map 'm.<UDIM>.exr' --plan
out_has 'm.1001.exr'
# Where there can be none: seen in the files.
expect 2 "${job[@]}" -o o.exr --map o.exr
err_has 'would be written to o.exr'
"$POUNCE_FIXTURE" splats -o s.ply --count 100 --target-size 16 >"$out"
expect 2 transfer s.ply s_target.glb -o o.png --map m.exr
err_has '--map'
# One map shows one search.
head -c 12288 /dev/zero | cat <(printf 'P6\n64 64\n255\n') - >occlusion.ppm
two=(transfer p.obj p.obj --source-texture 'baseColor=p.<UDIM>.png' --source-texture occlusion=occlusion.ppm --channels baseColor,occlusion)
expect 2 "${two[@]}" -o 'o.<CHANNEL>.png' --map m.exr
err_has 'need 2 searches'
expect 0 "${two[@]}" -o 'o.<CHANNEL>.png' --map m.exr --size 32
