# SPDX-License-Identifier: Apache-2.0
# --job: what a report records is run again, with the same bytes; the command line wins over it.
source "$(dirname "$0")/support.sh"
make_job
mask mask.pgm 16 16 $(for ((i = 0; i < 256; ++i)); do echo 99; done)
"$POUNCE_FIXTURE" splats -o scene.ply --count 2000 --target-size 64 >/dev/null
"$POUNCE_FIXTURE" plane -o s.obj --triangles 400 --uv-tiles 3 --texture 16 >/dev/null
"$POUNCE_FIXTURE" channels -o channels >/dev/null
channels=(channels/channels_src.glb channels/channels_target.glb)

# again COMMAND ARGUMENT...: the job, and the job of its report, write the same bytes.
again() {
  rm -rf out first
  mkdir out
  expect 0 "$@" --report r.json
  mv out first && mkdir out
  expect 0 "$1" --job r.json --report again.json
  diff -r first out || fail "other bytes from the report of: $*"
  diff <(sed -n '/"options"/,/}/p' r.json) <(sed -n '/"options"/,/}/p' again.json) || fail "other options: $*"
}
again transfer source.obj target.obj -o out/o.png --size 24x8 --depth u16 --padding 3 --coverage out/m.png --no-cache
again transfer s.obj s.obj -o 'out/<UDIM>.exr' --source-texture 'baseColor=s.<UDIM>.png' --tiles 1001-1002 \
  --exr-compression piz --tile-size 16 --mipmap --cache cache --memory 1GiB --threads 2
again transfer "${channels[@]}" -o 'out/<CHANNEL>.png' --channels baseColor,occlusion --output-for occlusion=out/x.tif --size 32
again transfer "${channels[@]}" -o out/o.glb --size 32 --factors factors
again transfer source.obj target.obj -o 'out/<CHANNEL>.exr' --bake normal,height --normal-y down --size 16 --max-distance 8% --max-angle 70.5
again transfer source.obj target.obj -o 'out/<CHANNEL>.png' --channels baseColor,mine,yours --source-texture mine=skin.ppm \
  --source-texture yours=skin.ppm --color mine --data yours --filter tent
again transfer source.obj target.obj source.obj -o 'out/<TARGET>.png' --method gaussian --sigma 0.8 --densify --no-wait
again transfer source.obj target.obj -o out/o.png --onto skin.ppm --mask mask.pgm --source-axes=x,-y,-z --target-axes=x,-y,-z
again transfer scene.ply scene_target.glb -o out/s.png --size 48 --look around --views 8 --sh dc --rays 2 --alpha --min-opacity 0.01 --max-scale 9 \
  --box -9,-9,-9,9,9,9 --near-target off --min-confidence 0.2
again maps target.obj -o 'out/<CHANNEL>.exr' --size 16
again gaussians source.obj -o out/g.ply --sigma 0.25 --sharpen 1
again gaussians scene.ply -o out/g.spz --count 500 --source-axes x,-y,-z

# The command line wins, also where it excludes what the file has.
expect 0 transfer source.obj target.obj -o o.png --size 8 --no-cache --report r.json
expect 0 transfer --job r.json --size 16 --cache cache -o p.png --report q.json
for text in '"size": "16x16"' '"cache": "cache"' '"output": "p.png"'; do grep -qF "$text" q.json || fail "no $text"; done
! grep -q '"no-cache"' q.json || fail 'both a cache and none'
# A plan is planned again.
expect 0 transfer source.obj target.obj -o plan.png --plan --report r.json
expect 0 transfer --job r.json
out_has 'plan.png'
[[ ! -e plan.png ]] || fail 'a plan was carried out'

# What is no job. Written by hand, numbers and switches may be JSON's own.
wrong() { # WORDS TEXT
  printf '%s\n' "$2" >wrong.json
  expect "${3-2}" transfer --job wrong.json
  err_has "wrong.json: $1"
}
wrong 'sice: unknown option; did you mean size?' '{"command": "transfer", "options": {"sice": 8}}'
wrong '--size: got "wide"' '{"command": "transfer", "options": {"size": "wide"}}'
wrong 'is a job of maps; run it with pounce maps --job wrong.json' '{"command": "maps", "options": {}}'
wrong 'not a report or job file' '{"options": {}}' 3
wrong 'not a report or job file' 'no JSON' 3
wrong 'options: "size"' '{"command": "transfer", "options": {"size": {}}}' 3
printf '{"command": "transfer", "options": {"source": "source.obj", "target": ["target.obj"], "output": "h.png", "size": 8, "mipmap": false, "no-cache": true}}' >hand.json
expect 0 transfer --job hand.json
expect 0 inspect h.png
out_has '8 x 8'
expect 2 transfer --job hand.json --size wide
err_has 'pounce: error: --size'
expect 2 transfer --job r.json --job hand.json
err_has 'given more than once'
expect 5 transfer --job absent.json
err_has 'absent.json'
