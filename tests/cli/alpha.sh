# SPDX-License-Identifier: Apache-2.0
# --alpha: of splat scenes, into what holds alpha; nothing else of the picture changes.
source "$(dirname "$0")/support.sh"
make_job
expect 2 transfer source.obj target.obj -o o.png --alpha
err_has '--alpha is about the Gaussians of a splat scene; source.obj is a mesh'
"$POUNCE_FIXTURE" splats -o scene.ply --count 20000 --target-size 128 >/dev/null
job=(transfer scene.ply scene_target.glb --size 128 --no-cache)
expect 2 "${job[@]}" -o o.jpg --alpha
err_has 'JPEG holds no alpha; choose .png, .tif or .exr'
expect 0 "${job[@]}" -o plain.png --coverage mask.png
expect 2 "${job[@]}" -o o.png --onto plain.png --alpha
err_has '--alpha: plain.png has no alpha to paint over'
[[ ! -e o.png && ! -e o.jpg ]] || fail 'an image was made'
expect 0 "${job[@]}" -o alpha.png --alpha --report r.json
tr -d ' \n' <r.json | grep -qF '"alpha":"true"' || fail 'the report does not tell of it'
expect 0 inspect plain.png
out_has '3 channels'
expect 0 inspect alpha.png
out_has '4 channels'
