# SPDX-License-Identifier: Apache-2.0
# UVs that waste their images are warned of, and texels far larger than a scene's Gaussians noted, with the size that shows more.
source "$(dirname "$0")/support.sh"
make_job
value() { tr -d ' \n' <r.json | sed -nE "s/.*\"$1\":([0-9.e-]+).*/\1/p"; }
is() { awk -v a="$1" -v b="$2" 'BEGIN { exit !(a > b * 0.9999 && a < b * 1.0001) }' || fail "$3: $1, not $2"; }
# A square of 3 x 3 whose UVs are 0.3 wide: 30 x 30 texels of 100 x 100, each 0.1 wide.
corners='v 0 0 0\nv 3 0 0\nv 3 3 0\nv 0 3 0\n'
printf "$corners"'vt 0 0\nvt 0.3 0\nvt 0.3 0.3\nvt 0 0.3\nf 1/1 2/2 3/3 4/4\n' >small.obj
job=(transfer source.obj small.obj -o o.png --size 100 --max-distance 10 --report r.json --no-cache)
expect 0 "${job[@]}"
grep -qF 'small.obj: its UVs use only 9 % of the images (900 of 10000 texels): pack the charts more tightly' "$err" ||
  fail "no warning of waste"
is "$(value fill)" 0.09 fill
is "$(value texel_size)" 0.1 "edge of a texel"
[[ $(value gaussian_size) == 0.0 ]] || fail "a mesh has no Gaussians"
# 40 x 40 of 100 x 100 are enough; a part that is painted over others is meant to be small.
printf "$corners"'vt 0 0\nvt 0.4 0\nvt 0.4 0.4\nvt 0 0.4\nf 1/1 2/2 3/3 4/4\n' >most.obj
expect 0 transfer source.obj most.obj -o m.png --size 100 --max-distance 10 --no-cache
! grep -q 'its UVs use' "$err" || fail "0.16 is warned of"
expect 0 "${job[@]}" --onto o.png
! grep -q 'its UVs use' "$err" || fail "painting over a part is warned of"

# A scene: texels of 16 x 16 images are far larger than 20,000 Gaussians, those of 1024 x 1024 are not.
"$POUNCE_FIXTURE" splats -o s.ply --count 20000 --target-size 64 >"$out"
expect 0 transfer s.ply s_target.glb -o s.png --size 16 --no-cache --report r.json
ratio=$(awk -v t="$(value texel_size)" -v g="$(value gaussian_size)" 'BEGIN { printf "%.1f", t / g }')
size=$(awk -v r="$ratio" 'BEGIN { for (s = 256; s < 16 * r / 1.75; s *= 2); print s }')
grep -qF "s_target.glb: texels are $ratio times as large as the scene's Gaussians (median), so finer detail is averaged; --size $size shows more" "$err" ||
  fail "no note of $ratio and $size"
expect 0 transfer s.ply s_target.glb -o s.png --size 1024 --no-cache --report r.json
! grep -q 'a texel is' "$err" || fail "a note about fine texels"
