# SPDX-License-Identifier: Apache-2.0
# --output-for CHANNEL=PATTERN: one run writes each channel in the format that suits it, with the bytes of a run of its own.
source "$(dirname "$0")/support.sh"
for text in height height=; do
  refused "--output-for: got \"$text\"" transfer a.glb b.glb -o '<CHANNEL>.png' --bake height --output-for "$text"
done
refused 'an image (.png, .jpg, .tif, .tx, .exr)' transfer a.glb b.glb -o '<CHANNEL>.png' --output-for height=o.glb
refused 'images are written as' transfer a.glb b.glb -o '<CHANNEL>.png' --output-for height=o.bmp
refused 'o.glb is a model' transfer a.glb b.glb -o o.glb --output-for normal=n.exr
refused 'this channel already has the output a.exr; specify one' \
  transfer a.glb b.glb -o '<CHANNEL>.png' --output-for height=a.exr --output-for height=b.exr
refused '<UDIM> must appear both in this pattern and in -o' transfer a.glb b.glb -o '<CHANNEL>.<UDIM>.png' --output-for height=h.exr
refused '<MATERIAL> must appear both in this pattern and in -o' transfer a.glb b.glb -o o.png --output-for 'height=<MATERIAL>.exr'
refused '--onto also needs <CHANNEL>' transfer a.glb b.glb -o o.png --onto p.png --output-for normal=n.png
refused '--exr-compression applies only to EXR output' \
  transfer a.glb b.glb -o '<CHANNEL>.png' --output-for height=h.tif --exr-compression piz

make_job
job=(transfer source.obj target.obj --bake normal,height --size 32 --no-cache)
# What was refused as a whole: heights need floats, normals as PNG are what engines read.
expect 2 "${job[@]}" -o 'all/<CHANNEL>.png'
err_has 'signed values need half or float samples'
expect 0 "${job[@]}" -o 'all/<CHANNEL>.png' --output-for height=all/height.exr --exr-compression piz --report r.json
only_files all r.json skin.ppm source.mtl source.obj target.obj
[[ $(ls all | tr '\n' ' ') == 'baseColor.png height.exr normal.png ' ]] || fail "there are $(ls all)"
grep -A1 '"output-for": \[' r.json | grep -q '"height=all/height.exr"' || fail 'the report lacks the option'
expect 0 inspect all/height.exr --json
out_has '"depth": "float"'
expect 0 inspect all/normal.png --json
out_has '"depth": "u8"'
# Each has the bytes of a run of its own, its job among them, and is found up to date by the other.
mkdir alone
expect 0 "${job[@]}" -o 'alone/<CHANNEL>.exr' --exr-compression piz
cmp all/height.exr alone/height.exr || fail 'another height than in a run of EXRs'
expect 0 "${job[@]}" -o 'all/<CHANNEL>.png' --output-for height=all/height.exr --exr-compression piz --skip-existing
err_has 'skipped 3'
# The plan names them; a mask goes along; without <CHANNEL> a channel with its own pattern is no second image of one name.
expect 0 "${job[@]}" -o n.png --output-for height=h.exr --coverage '<CHANNEL>_mask.png' --plan
for line in 'would write   n.png' 'would write   h.exr' 'would write   normal_mask.png' 'would write   height_mask.png'; do
  out_has "$line"
done
expect 0 "${job[@]}" -o n.png --output-for height=h.exr --coverage '<CHANNEL>_mask.png'
same_picture n.png all/normal.png || fail "another normal map"
# What is no channel of this job is said; so is a name that two images would have.
expect 2 "${job[@]}" -o '<CHANNEL>.png' --output-for height=height.exr --output-for position=p.exr
err_has '--output-for position=p.exr: this job writes no position; add it to --channels or --bake'
expect 2 "${job[@]}" -o '<CHANNEL>.exr' --output-for height=normal.exr
err_has 'normal.exr'
# A map of the user's own, over UDIMs, in another format.
printf '%s\n' 'v 0 0 0' 'v 2 0 0' 'v 2 1 0' 'v 0 1 0' 'vt 0 0' 'vt 2 0' 'vt 2 1' 'vt 0 1' 'f 1/1 2/2 3/3 4/4' >tiles.obj
expect 0 transfer source.obj tiles.obj -o '<CHANNEL>.<UDIM>.png' --source-texture rough=skin.ppm --size 16 --no-cache \
  --output-for 'rough=r/<UDIM>.tif'
[[ -s r/1001.tif && -s r/1002.tif && -s baseColor.1002.png && ! -e rough.1001.png ]] || fail "there are $(ls . r)"
