# SPDX-License-Identifier: Apache-2.0
# What 8 and 16 bit cannot hold of an HDR texture is counted, said and reported, with the cure.
source "$(dirname "$0")/support.sh"
quad target
quad source skin.hdr
# A Radiance image of 8 x 8 equal texels: 2, 0.5, 0.
{
  printf '#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 8\n'
  for ((i = 0; i < 64; ++i)); do samples 128 32 0 130; done
} >skin.hdr
expect 0 transfer source.obj target.obj -o o.png --report report.json
err_has 'o.png: 64 samples of baseColor were clipped: u16 holds 0 to 1; use --depth half or float with .exr to keep them'
[[ $(grep -c clipped "$err") == 1 ]] || fail 'said more than once'
grep -q '"clipped": 64' report.json || fail 'the report does not say so'
expect 0 transfer source.obj target.obj -o o.exr --report report.json
grep -q '"clipped": 0' report.json || fail 'nothing is clipped in float'
if grep -q clipped "$err"; then fail 'a warning of nothing'; fi
# Painted over: what is hidden is not counted, neither the old samples nor, under a black mask, the new ones.
job=(transfer source.obj target.obj -o o.png --depth u16 --no-cache --report report.json)
expect 0 "${job[@]}" --onto skin.hdr
grep -q '"clipped": 64' report.json || fail 'the old samples under the new ones are counted'
image grey.ppm 8 8 9 9 9
mask black.pgm 8 8 $(for ((i = 0; i < 64; ++i)); do echo 0; done)
mask half.pgm 8 8 $(for ((i = 0; i < 64; ++i)); do echo $((i < 32 ? 255 : 0)); done)
expect 0 "${job[@]}" --onto grey.ppm --mask black.pgm
grep -q '"clipped": 0' report.json || fail 'nothing was painted, so nothing was clipped'
if grep -q clipped "$err"; then fail 'a warning of nothing'; fi
quad plain grey.ppm
expect 0 transfer plain.obj target.obj -o o.png --depth u16 --no-cache --report report.json --onto skin.hdr --mask half.pgm
grep -q '"clipped": 32' report.json || fail 'the old samples that stay are not counted'
