# SPDX-License-Identifier: Apache-2.0
# --sh, --min-opacity, --max-scale, --box, --min-confidence and --near-target: what they refuse, what the help and the report say of them.
source "$(dirname "$0")/support.sh"
rejected --sh DC degree3 ''
rejected --min-opacity 0 0.003 1.5 half ''
rejected --max-scale 0 -1 big ''
rejected --box 1 0,0,0,1,1 0,0,0,1,1,1,1 0,0,0,1,1,x "0;0;0,1,1,1" ''
rejected --near-target 0 -1 101% on ''
rejected --min-confidence -0.1 1.1 sure ''
refused 'expected six numbers' transfer a.glb b.glb -o o.png --box 0,0,1,1,1,0
expect 0 transfer --help
for word in '--sh ' '--min-opacity ' '--max-scale ' '--box ' '--near-target ' '--min-confidence ' '[default: mean]'; do out_has "$word"; done

make_job
for given in '--sh dc' '--min-opacity 0.5' '--max-scale 1' '--box 0,0,0,1,1,1' '--near-target 1' '--near-target off' \
  '--min-confidence 0.5'; do
  # shellcheck disable=SC2086
  expect 2 transfer source.obj target.obj -o o.png $given
  err_has "${given%% *} applies only to splat scenes; source.obj is a mesh"
done
[[ ! -e o.png ]] || fail 'an image was made'

"$POUNCE_FIXTURE" splats -o scene.ply --count 2000 --target-size 64 >/dev/null
json() { tr -d ' \n' <r.json | grep -qF -- "$1" || fail "the report lacks $1: $(cat r.json)"; }
job=(transfer scene.ply scene_target.glb -o o.png --size 64 --report r.json)
expect 0 "${job[@]}" -q
json '"filtered":{}'
json '"notes":[]'
cp o.png all.png
expect 0 "${job[@]}" --sh normal --min-opacity 0.004 --max-scale 5 --box -99,-99,-99,99,99,99 --near-target 100%
json '"sh":"normal","min-opacity":"0.004","max-scale":"5","box":"-99,-99,-99,99,99,99","near-target":"100%"'
same_picture all.png o.png || fail 'nothing was left out, and the picture is another'
# Half of the scene; then nothing of it.
expect 0 "${job[@]}" --box 0,-9,-9,9,9,9 --near-target off
json '"near-target":"off"'
inside=$(grep -o '"gaussians": [0-9]*' r.json | grep -o '[0-9]*')
with_comma=$(printf "%d" $((2000 - inside)) | sed -E 's/^([0-9])([0-9]{3})$/\1,\2/')
err_has "$with_comma Gaussians left out: $with_comma outside of --box"
grep -q '"outside_box": [0-9]' r.json || fail "nothing is outside the box: $(cat r.json)"
expect 3 "${job[@]}" --box 7,7,7,8,8,8
err_has '2000 outside of --box'
