# SPDX-License-Identifier: Apache-2.0
# Painting over an image: what is covered and masked is new, all else keeps its samples.
source "$(dirname "$0")/support.sh"
refused '--mask needs --onto' transfer a.obj b.obj -o o.png --mask m.pgm
make_job
image old.ppm 8 8 10 20 30
printf '%s\n' 'v 0 0 0' 'v .5 0 0' 'v .5 1 0' 'v 0 1 0' 'vt 0 0' 'vt .5 0' 'vt .5 1' 'vt 0 1' \
  'f 1/1 2/2 3/3 4/4' >half.obj
expect 0 transfer source.obj half.obj -o o.tif --onto old.ppm --padding 0
row=(200 100 50 200 100 50 200 100 50 200 100 50 10 20 30 10 20 30 10 20 30 10 20 30)
image wanted.ppm 8 8 "${row[@]}" "${row[@]}" "${row[@]}" "${row[@]}" "${row[@]}" "${row[@]}" "${row[@]}" "${row[@]}"
expect 0 compare o.tif wanted.ppm --min-psnr 99
mask black.pgm 8 8 $(yes 0 | head -64)
expect 0 transfer source.obj target.obj -o same.tif --onto old.ppm --mask black.pgm
expect 0 compare same.tif old.ppm --min-psnr 99
expect 0 transfer source.obj target.obj -o same.tif --onto same.tif
expect 3 transfer source.obj target.obj -o o.png --onto gone.png
expect 3 transfer source.obj target.obj -o o.png --onto old.ppm --size 16
err_has 'old.ppm: --onto has 8 x 8 texels, but the output 16 x 16'
