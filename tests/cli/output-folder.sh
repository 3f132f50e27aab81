# SPDX-License-Identifier: Apache-2.0
# An OUTPUT in a folder that does not exist, or that is a folder, is exit 5 and named.
source "$(dirname "$0")/support.sh"
make_job
expect 5 transfer source.obj target.obj -o missing/o.png
err_has 'missing'
mkdir taken.png
expect 5 transfer source.obj target.obj -o taken.png
err_has 'taken.png'
expect 5 transfer source.obj target.obj -o o.png --coverage missing/mask.png
err_has 'missing'
expect 5 transfer source.obj target.obj -o o.png --report missing/report.json
err_has 'missing/report.json'
expect 5 maps target.obj -o 'missing/<CHANNEL>.exr'
err_has 'missing'
only_files skin.ppm source.mtl source.obj taken.png target.obj
# Tokens may be in the folders: scratch files are where those begin.
mkdir -p tree/baseColor tree/target
expect 0 transfer source.obj target.obj -o 'tree/<CHANNEL>/o.png' --no-cache -q
expect 0 transfer source.obj target.obj -o 'tree/<TARGET>/o.png' --no-cache -q
[[ -s tree/baseColor/o.png && -s tree/target/o.png ]] || fail 'an image is missing'
mkdir target
expect 0 transfer source.obj target.obj -o '<TARGET>/o.png' --no-cache -q
[[ -s target/o.png ]] || fail 'an image is missing'
