# SPDX-License-Identifier: Apache-2.0
# Folders of outputs that are not there are made when something is written into them, and only then. What cannot be a
# folder is exit 5 and named.
source "$(dirname "$0")/support.sh"
make_job
inputs=(skin.ppm source.mtl source.obj target.obj)
expect 0 transfer source.obj target.obj -o new/deep/o.png --coverage masks/m.png --report logs/run/report.json --no-cache -q
[[ -s new/deep/o.png && -s masks/m.png && -s logs/run/report.json ]] || fail 'an output is missing'
expect 0 maps target.obj -o 'maps/<CHANNEL>/m.exr' --size 4 -q
[[ -s maps/mask/m.exr ]] || fail 'a map is missing'
expect 0 gaussians source.obj -o splats/new/scene.ply -q
[[ -s splats/new/scene.ply ]] || fail 'the splats are missing'
rm -r new masks logs maps splats
# Neither a plan nor a job that fails leaves a folder.
expect 0 transfer source.obj target.obj -o new/deep/o.png --plan
out_has 'would write   new/deep/o.png'
expect 3 transfer target.obj target.obj -o new/deep/o.png
expect 4 transfer source.obj target.obj -o new/deep/o.png --memory 1MiB --no-cache
(ulimit -f 0 && expect 5 transfer source.obj target.obj -o new/deep/o.png --no-cache -q --temp /tmp) || exit 1
only_files "${inputs[@]}"
# What cannot be made is said before any work.
mkdir taken.png
expect 5 transfer source.obj target.obj -o taken.png
err_has 'taken.png: is a folder'
expect 5 transfer source.obj target.obj -o skin.ppm/new/o.png
err_has 'skin.ppm/new/o.png: skin.ppm is not a folder'
expect 5 transfer source.obj target.obj -o o.png --report skin.ppm/report.json
err_has 'skin.ppm/report.json'
if [[ $(id -u) != 0 ]]; then
  mkdir locked && chmod a-w locked
  expect 5 transfer source.obj target.obj -o locked/new/o.png --plan
  err_has 'the folder locked/new cannot be made in locked'
  rmdir locked
fi
only_files "${inputs[@]:0:3}" taken.png target.obj
# Tokens may be in the folders.
expect 0 transfer source.obj target.obj -o 'tree/<CHANNEL>/o.png' --no-cache -q
expect 0 transfer source.obj target.obj -o 'tree/<TARGET>/o.png' --no-cache -q
[[ -s tree/baseColor/o.png && -s tree/target/o.png ]] || fail 'an image is missing'
expect 0 transfer source.obj target.obj -o '<TARGET>/o.png' --no-cache -q
[[ -s target/o.png ]] || fail 'an image is missing'
