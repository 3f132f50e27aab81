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
expect 5 transfer source.obj target.obj -o o.png --onto gone.png
expect 3 transfer source.obj target.obj -o o.png --onto old.ppm --size 16
err_has 'old.ppm: --onto has 8 x 8 texels, but the output has 16 x 16'
# Neither a mask nor what another image is painted onto is written over.
expect 0 compare same.tif old.ppm
cp same.tif mask.tif
sums=$(md5sum -- *)
expect 2 transfer source.obj target.obj -o mask.tif --onto old.ppm --mask mask.tif
err_has 'mask.tif: is also an input'
{ cat target.obj && echo 'usemtl b' && echo 'f 1/1 2/2 3/3'; } >two.obj
printf 'usemtl a\n' | cat - two.obj >x && mv x two.obj
expect 0 transfer source.obj two.obj -o '<MATERIAL>.<UDIM>.tif' --size 8 -q
mv b.1001.tif b.u1_v1.tif && cp a.1001.tif a.u1_v1.tif
expect 2 transfer source.obj two.obj -o '<MATERIAL>.u1_v1.tif' --onto a.u1_v1.tif
err_has 'a.u1_v1.tif: is also an input'
expect 2 transfer source.obj two.obj -o '<MATERIAL>.u1_v1.tif' --onto old.ppm --mask 'b.u1_v1.tif'
expect 2 transfer source.obj two.obj -o '<MATERIAL>.<UVTILE>.tif' --onto 'a.<UVTILE>.tif'
err_has 'a.u1_v1.tif: is also an input'
expect 0 transfer source.obj two.obj -o '<MATERIAL>.<UVTILE>.tif' --onto '<MATERIAL>.<UVTILE>.tif' -q
md5sum -c --quiet <<<"$sums" || fail 'an input has changed'
