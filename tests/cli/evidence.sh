# SPDX-License-Identifier: Apache-2.0
# --channels confidence,distance: images, names and refusals; a scene that lies elsewhere is said so.
source "$(dirname "$0")/support.sh"
make_job
expect 2 transfer source.obj target.obj -o o.exr --channels confidence
err_has '--channels confidence: confidence applies only to splat scenes; source.obj is a mesh'
expect 2 transfer source.obj target.obj -o o.exr --channels distance
err_has '--channels distance: distance applies only to splat scenes; source.obj is a mesh'
expect 2 transfer source.obj target.obj -o o.exr --channels all,confidence
err_has 'got "all,confidence", expected all alone, or the channels by name: baseColor,confidence'
"$POUNCE_FIXTURE" splats -o scene.ply --count 4000 --target-size 64 >/dev/null
job=(transfer scene.ply scene_target.glb --size 32 --no-cache)
expect 2 "${job[@]}" -o '<CHANNEL>.png' --channels baseColor,distance
err_has 'signed values need half or float samples'
err_has 'write .exr or .tif'
expect 2 "${job[@]}" -o o.glb --channels confidence
err_has 'o.glb is a model'
expect 2 "${job[@]}" -o o.exr --channels baseColor,confidence
err_has 'add <CHANNEL> to the pattern'
expect 0 "${job[@]}" -o '<CHANNEL>.exr' --channels all
[[ -e baseColor.exr && ! -e confidence.exr ]] || fail 'all is what a scene looks like'
expect 0 "${job[@]}" -o '<CHANNEL>.tif' --channels baseColor,confidence,distance --report r.json
grep -q '"fit": 1.0' r.json || fail "the scene lies there: $(cat r.json)"
for channel in baseColor confidence distance; do [[ -e $channel.tif ]] || fail "no $channel"; done
expect 0 inspect distance.tif
out_has '1 channel, float'
expect 0 inspect confidence.tif
out_has '1 channel, u8'
# What asked for too much is named, and nothing that would change nothing.
expect 0 "${job[@]}" -o sure.png --min-confidence 1
err_has 'raise --max-distance, or lower --min-confidence (1)'
err_has 'The scene without its outer tenths ("middle" in pounce inspect) spans'
! grep -qF -- --max-angle "$err" || fail '--max-angle does nothing here'
# A plane across the scene: told of in the summary, as a warning and in the report.
expect 0 transfer scene.ply target.obj -o far.png --size 16 --no-cache --report r.json
err_has 'target.obj: fit 0.00 of 1'
err_has "target.obj: the scene does not match this target's surface (fit 0.00 of 1): 0.00 % of its texels are covered"
for cure in --source-axes --max-distance '--min-confidence 0'; do err_has "$cure"; done
grep -q '"fit": 0.0' r.json || fail "it fits: $(cat r.json)"
# A head in a sphere of about its size and a sphere in a head are found everywhere, but regions lie off.
"$POUNCE_FIXTURE" splats -o ball.ply --shape sphere --count 4000 --target-size 64 >/dev/null
for pair in 'scene ball' 'ball scene'; do
  expect 0 transfer "${pair% *}.ply" "${pair#* }_target.glb" -o far.png --size 32 --no-cache
  err_has '(fit 0.00 of 1): 0.00 % of its texels are covered'
done
expect 0 transfer ball.ply ball_target.glb -o ball.png --size 32 --no-cache --report r.json
grep -q '"fit": 1.0' r.json || fail "the ball lies there: $(cat r.json)"
! grep -q 'warning' "$err" || fail 'a warning without a reason'
# Beyond --max-distance, but there: warnings have the distance that reaches it.
"$POUNCE_FIXTURE" splats -o ball.ply --shape sphere --interior 0 --floaters 0 --haze 0 --target-size 64 --target-offset 4.5 >/dev/null
given() { grep -o -- 'use --max-distance [0-9.]*' "$err" | head -n1 | cut -d' ' -f3; }
expect 0 transfer ball.ply ball_target.glb -o out.png --size 32 --no-cache
err_has "does not match this target's surface (fit 0.00 of 1)"
expect 0 transfer ball.ply ball_target.glb -o out.png --size 32 --no-cache --max-distance "$(given)"
! grep -q 'warning' "$err" || fail 'the distance that is given does not do'
"$POUNCE_FIXTURE" splats -o ball.ply --shape sphere --interior 0 --floaters 0 --haze 0 --target-size 64 --target-offset 2.5 >/dev/null
expect 0 transfer ball.ply ball_target.glb -o out.png --size 32 --no-cache --max-distance 0.5% --report r.json
grep -q '"fit": 1.0' r.json || fail "the ball lies there: $(cat r.json)"
err_has 'the result is empty'
expect 0 transfer ball.ply ball_target.glb -o out.png --size 32 --no-cache --max-distance "$(given)"
! grep -q 'warning' "$err" || fail 'the distance that is given does not do'
# In other units: no Gaussian is near, which is told like any other place that is not the target's.
awk '$1 == "v" { $2 *= 1000; $3 *= 1000; $4 = $4 * 1000 + 500 } 1' target.obj >units.obj
expect 0 transfer scene.ply units.obj -o far.png --size 16 --no-cache --report r.json
err_has 'units.obj: the scene does not match this target'"'"'s surface (fit 0.00 of 1)'
for part in 'The scene without its outer tenths ("middle" in pounce inspect) spans (' 'the target (' --source-axes units; do err_has "$part"; done
! grep -q '"out_of_reach"' r.json || fail "nothing is left out where nothing is near: $(cat r.json)"
# Of a mesh nobody knows.
expect 0 transfer source.obj target.obj -o mesh.png --report r.json
grep -q '"fit": 1.0' r.json || fail "the mesh lies there: $(cat r.json)"
