# SPDX-License-Identifier: Apache-2.0
# --look and --views: what they refuse, what auto decides, what a second job finds in the cache, and that memory does
# not show in the bytes.
source "$(dirname "$0")/support.sh"
rejected --look Auto side ''
rejected --views 5 97 -1 1.5 many ''
make_job
for given in '--look around' '--views 8'; do
  # shellcheck disable=SC2086
  expect 2 transfer source.obj target.obj -o o.png $given
  err_has "${given%% *} applies only to splat scenes; source.obj is a mesh"
done
[[ ! -e o.png ]] || fail 'an image was written'

# Discs of a surface are looked at along normals; needles from around.
"$POUNCE_FIXTURE" splats -o discs.ply --shape sphere --count 4000 --target-size 64 >/dev/null
"$POUNCE_FIXTURE" splats -o needles.ply --shape sphere --count 8000 --needles 1 --interior 0 --floaters 0 --haze 0 --target-size 64 >/dev/null
json() { tr -d ' \n' <r.json | grep -qF -- "$1" || fail "the report lacks $1: $(cat r.json)"; }
stage() { python3 -c 'import json,sys; print([s["cached"] for s in json.load(open("r.json"))["stages"] if s["name"] == "views"])' | grep -q "$1" || fail "views cached: $1 was expected: $(cat r.json)"; }
expect 0 transfer discs.ply discs_target.glb -o o.png --size 64 --cache cache --report r.json
json '"views":0'
expect 0 transfer needles.ply needles_target.glb -o auto.png --size 1024 --cache cache --report r.json
json '"views":36'
stage False
expect 0 transfer needles.ply needles_target.glb -o around.png --size 1024 --look around --no-cache --report r.json
json '"views":36'
json '"look":"around"'
same_picture auto.png around.png || fail 'auto is not around for needles'
expect 0 transfer needles.ply needles_target.glb -o large.png --size 1500 --cache cache --report r.json
stage True
expect 0 transfer needles.ply needles_target.glb -o along.png --size 1024 --look normal --no-cache --report r.json
json '"views":0'
same_picture auto.png along.png && fail 'along normals it looks the same'

# The least memory gives the same bytes; less is refused.
job=(transfer needles.ply needles_target.glb --size 64 --views 6 --no-cache --report r.json)
expect 0 "${job[@]}" -o six.png
least=$(grep -o '"least": [0-9]*' r.json | grep -o '[0-9]*')
expect 0 "${job[@]}" -o least.png --memory "$least" --threads 1
cmp six.png least.png || fail 'memory and threads show in the bytes'
expect 4 "${job[@]}" -o less.png --memory $((least - 1000000)) --threads 1
# Evidence of views.
expect 0 transfer needles.ply needles_target.glb --channels baseColor,confidence,distance -o '<CHANNEL>.exr' --size 64 --no-cache
expect 0 transfer needles.ply needles_target.glb -o alpha.png --alpha --size 64 --no-cache
