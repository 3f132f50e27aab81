# SPDX-License-Identifier: Apache-2.0
# --method, --sigma and --densify: what they refuse, what the help and the report say of them.
source "$(dirname "$0")/support.sh"
rejected --method paper Gaussian ''
rejected --sigma 0 0.05 5 wide ''
refused '--sigma applies only to --method gaussian' transfer a.glb b.glb -o o.png --sigma 0.7
refused '--densify applies only to --method gaussian' transfer a.glb b.glb -o o.png --densify
refused 'transfers only baseColor' transfer a.glb b.glb -o o.png --method gaussian --channels occlusion
refused 'transfers only baseColor' transfer a.glb b.glb -o '<CHANNEL>.png' --method gaussian --channels all
rejected --filter bilinear Cubic ''
refused '--filter applies only to --method surface' transfer a.glb b.glb -o o.png --method gaussian --filter tent
expect 0 transfer --help
for word in '--method ' '--filter ' '[default: cubic]' '--sigma ' '--densify' 'surface: ' 'gaussian: ' '[default: surface]'; do out_has "$word"; done

make_job
expect 0 transfer source.obj target.obj -o g.png --method gaussian --sigma 0.75 --densify --report r.json -q
json() { tr -d ' \n' <r.json | grep -qF -- "$1" || fail "the report lacks $1: $(cat r.json)"; }
json '"method":"gaussian","filter":""'
json '"sigma":0.75,"densify":true'
json '"gaussians":256,'
json '"method":"gaussian","sigma":"0.75","densify":"true"'
# One colour everywhere: both methods give it.
expect 0 transfer source.obj target.obj -o s.png --method surface --report r.json -q
json '"method":"surface","filter":"cubic"'
expect 0 transfer source.obj target.obj -o t.png --filter tent --plan --report r.json -q
json '"method":"surface","filter":"tent"'
json '"output":"t.png","filter":"tent","plan":"true"}'
expect 0 transfer source.obj target.obj -o s.png --report r.json -q
json '"sigma":0.0,"densify":false'
expect 0 compare g.png s.png --min-psnr 100
# A model or a pattern means all channels; what the method leaves out is said.
"$POUNCE_FIXTURE" channels -o channels >/dev/null
source=$(find channels -name '*_src.glb') target=$(find channels -name '*_target.glb')
expect 0 transfer "$source" "$target" -o '<CHANNEL>.png' --method gaussian
err_has 'transfers only baseColor; left out: metallicRoughness, occlusion'
[[ -e baseColor.png && ! -e occlusion.png ]] || fail "files: $(ls)"
# Gaussians of a scene have their own sizes; the method is the scene's own.
"$POUNCE_FIXTURE" splats -o scene.ply --count 2000 --target-size 64 >/dev/null
expect 2 transfer scene.ply scene_target.glb -o o.png --method gaussian --sigma 1
err_has '--sigma applies only to meshes; scene.ply is a splat scene'
expect 2 transfer scene.ply scene_target.glb -o o.png --filter sharp
err_has '--filter applies only to meshes; scene.ply is a splat scene'
expect 0 transfer scene.ply scene_target.glb -o one.png --size 64 --method gaussian -q
expect 0 transfer scene.ply scene_target.glb -o two.png --size 64 -q
same_picture one.png two.png || fail 'a scene is blended differently'
# The least memory that is named works; disk stays within the forecast.
"$POUNCE_FIXTURE" head -o head --triangles 20000 --texture 512 --target-size 64 >/dev/null
job=(transfer head/head_src.glb head/head_same.glb -o h.png --size 512 --method gaussian --no-cache --report r.json)
expect 4 "${job[@]}" --memory 4MiB
least=$(grep -o -- '--memory [0-9]*MiB$' "$err" | cut -d' ' -f2)
expect 0 "${job[@]}" --memory "$least" -q
peak=$(sed -n 's/.*"temp_peak": \([0-9]*\).*/\1/p' r.json)
most=$(sed -n 's/.*"scratch": \([0-9]*\).*/\1/p' r.json)
((peak <= most)) || fail "scratch files took $peak bytes, the forecast was $most"
