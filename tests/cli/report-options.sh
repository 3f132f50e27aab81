# SPDX-License-Identifier: Apache-2.0
# A report has every option that a job can be given, by the name that its help has.
source "$(dirname "$0")/support.sh"
make_job
mask mask.pgm 16 16 $(for ((i = 0; i < 256; ++i)); do echo 255; done)
# Options of how things are said, not of what is done.
said=' help quiet verbose progress report job redo task job-folder '
# reported COMMAND: the options in r.json are among those that were seen of it.
seen=
reported() {
  seen+=" $(tr -d '\n' <r.json | sed -E 's/.*"options": \{([^}]*)\}.*/\1/' | grep -oE '"[a-z-]+":' | tr -d '":' | tr '\n' ' ')"
}
job() { expect 0 "$@" --report r.json && reported; }
# An option whose help has a range is given the end of it here, unless a job below has it.
numbered() { # COMMAND OPTION
  local highest output
  highest=$("$POUNCE" "$1" --help | tr -s ' \n' ' ' | sed -nE "s/.* --$2 [^[]*\[[0-9.]+ to ([0-9.]+).*/\1/p")
  [[ -n $highest ]] || return 0
  # Options of a file format are refused for the others.
  for output in o.png o.jpg o.exr; do
    "$POUNCE" "$1" source.obj target.obj -o "$output" --no-cache --plan "--$2" "$highest" >"$out" 2>&1 && break
  done
  job "$1" source.obj target.obj -o "$output" --no-cache --plan "--$2" "$highest"
}
all_of() { # COMMAND
  expect 0 "$1" --help
  local option
  for option in $(grep -oE '^  (-[a-z], ?)?--[a-z-]+' "$out" | grep -oE '\-\-[a-z-]+' | sed 's/^--//' | sort -u); do
    [[ $said$seen == *" $option "* ]] || numbered "$1" "$option"
    [[ $said$seen == *" $option "* ]] || fail "no report of $1 has --$option"
  done
  seen=
}
machine=(--memory 1GiB --threads 2 --cache cache --cache-readonly . --cache-limit 1GB --no-wait --temp . --max-temp none)
job transfer source.obj target.obj -o 'o.<UDIM>.png' --coverage 'm.<UDIM>.png' --map 'p.<UDIM>.exr' --tiles 1001 --size 8 --depth u16 --padding 2 \
  --min-coverage 1 --channels baseColor --source-texture baseColor=skin.ppm --source-material skin --source-uv-set 0 \
  --source-axes y,x,z --target-axes y,x,z --max-distance 1 --max-angle 70 --filter tent --source-colorspace srgb \
  --output-colorspace srgb --allow-external "${machine[@]}" --plan
job transfer source.obj target.obj -o o.png --skip-existing --no-cache --factors ignore --allow-format tga --sandbox off --output-for baseColor=o.exr --source-texture m=skin.ppm --data m \
  --source-texture c=skin.ppm --color c
printf 'ocio_profile_version: 1\nsearch_path: ""\nroles: {default: lin_rec709}\ndisplays:\n  d:\n    - !<View> {name: v, colorspace: lin_rec709}\ncolorspaces:\n  - !<ColorSpace> {name: lin_rec709}\n  - !<ColorSpace> {name: film}\n' >c.ocio
job transfer source.obj target.obj -o o.png --no-cache --ocio c.ocio --output-colorspace film
job transfer source.obj target.obj -o o.exr --no-cache --exr-compression piz --tile-size 32 --mipmap --drop-alpha
job transfer source.obj target.obj -o b.png --bake normal --normal-y down --output-normal-y down --size 8 --no-cache
job transfer source.obj target.obj -o g.png --method gaussian --sigma 1 --densify --no-cache
job transfer source.obj target.obj -o o.png --onto o.png --mask mask.pgm --no-cache
sed 's/^usemtl/o thing\nusemtl/' source.obj >named.obj
job transfer named.obj named.obj -o n.png --source-mesh thing --target-mesh thing --target-material skin --no-cache
"$POUNCE_FIXTURE" splats -o scene.ply --count 2000 --target-size 64 >/dev/null
job transfer scene.ply scene_target.glb -o s.png --size 16 --no-cache --sh dc --min-opacity 0.01 --max-scale 9 \
  --box -9,-9,-9,9,9,9 --near-target 50% --look normal --views 30 --rays 1 --alpha --min-confidence 0.2
# What fails says its options, too.
failed() { expect 3 "$@" --report r.json && reported; }
failed transfer named.obj named.obj -o n.png --target-uv-set 1
all_of transfer
job maps named.obj -o '<CHANNEL>.exr' --size 8 --target-mesh thing --target-material skin \
  --target-axes y,x,z --allow-external "${machine[@]}"
job maps named.obj -o '<CHANNEL>.exr' --no-cache
failed maps named.obj -o '<CHANNEL>.exr' --target-uv-set 1
all_of maps
job gaussians source.obj -o s.ply --allow-format bmp --sandbox off --source-texture baseColor=skin.ppm --source-colorspace srgb --ocio c.ocio --sigma 0.25 --sharpen 1 --allow-external "${machine[@]}"
job gaussians scene.ply -o s.glb --source-axes x,-y,-z --min-opacity 0.01 --max-scale 9 --box -9,-9,-9,9,9,9 --count 100 --no-cache
all_of gaussians
# An image that is painted over in place was read.
expect 0 transfer source.obj target.obj -o o.png --onto o.png --report r.json
tr -d ' \n' <r.json | grep -qF '"inputs":["source.obj","target.obj","source.mtl","skin.ppm","o.png"]' ||
  tr -d ' \n' <r.json | grep -qE '"inputs":\[[^]]*"o.png"' || fail 'o.png is no input'
# Channels and disk of the commands that are not transfer.
expect 0 maps target.obj -o '<CHANNEL>.exr' --size 8 --report r.json
tr -d ' \n' <r.json | grep -qF '"channels":[{"name":"position","images":1,"texels":64,"covered":64,"empty":0,"filled":0},' ||
  fail 'the channels of maps'
tr -d ' \n' <r.json | grep -qF '"disk_most":null' || fail 'a forecast that nobody made'
expect 0 gaussians source.obj -o s.ply --report r.json
tr -d ' \n' <r.json | grep -qF '"disk_most":null' || fail 'a forecast that nobody made'
