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
err_has 'o.png: 64 samples of baseColor were clipped: u16 holds 0 to 1; --depth half or float with .exr keeps them'
[[ $(grep -c clipped "$err") == 1 ]] || fail 'said more than once'
grep -q '"clipped": 64' report.json || fail 'the report does not say so'
expect 0 transfer source.obj target.obj -o o.exr --report report.json
grep -q '"clipped": 0' report.json || fail 'nothing is clipped in float'
if grep -q clipped "$err"; then fail 'a warning of nothing'; fi
