# SPDX-License-Identifier: Apache-2.0
# --rays: what it refuses; the picture is softer, its texels, counts and bytes are not of this machine's making.
source "$(dirname "$0")/support.sh"
rejected --rays -1 17 1.5 many ''
make_job
expect 2 transfer source.obj target.obj -o o.png --rays 3
err_has '--rays applies only to splat scenes; source.obj is a mesh'
[[ ! -e o.png ]] || fail 'an image was made'

"$POUNCE_FIXTURE" splats -o scene.ply --count 20000 --target-size 128 >/dev/null
json() { tr -d ' \n' <r.json | grep -qF -- "$1" || fail "the report lacks $1: $(cat r.json)"; }
job=(transfer scene.ply scene_target.glb --size 128 --no-cache --report r.json)
expect 0 "${job[@]}" -o none.png --coverage none.mask.png
least=$(grep -o '"least": [0-9]*' r.json | grep -o '[0-9]*')
expect 0 "${job[@]}" -o zero.png --rays 0
json '"output":"zero.png","size":"128x128","no-cache":"true"}'
same_picture none.png zero.png || fail '--rays 0 is not the default'
expect 0 "${job[@]}" -o all.png --coverage all.mask.png --rays 16
json '"rays":"16"'
same_picture none.png all.png && fail 'further rays see nothing else'
same_picture none.mask.png all.mask.png || fail 'further rays cover other texels'
more=$(grep -o '"least": [0-9]*' r.json | grep -o '[0-9]*')
((more > least + 5000000)) || fail "17 profiles need hardly more than one: $more, $least"
# The least memory, in which scenes go past in batches, and one thread give the same bytes; less is refused.
expect 0 "${job[@]}" -o least.png --rays 16 --memory "$more" --threads 1
cmp all.png least.png || fail 'memory and threads show in the bytes'
expect 4 "${job[@]}" -o less.png --rays 16 --memory $((more - 1000000)) --threads 1
