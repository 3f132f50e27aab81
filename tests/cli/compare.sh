# SPDX-License-Identifier: Apache-2.0
# compare prints similarity, PSNR and the largest error with its place.
source "$(dirname "$0")/support.sh"
image a.ppm 4 4 100 100 100
gray='100 100 100'
image b.ppm 4 4 $gray $gray $gray $gray $gray $gray 100 151 100 $gray
expect 0 compare a.ppm b.ppm
silent "$err"
# One of 48 samples is off by 51/255 = 0.2: mean 0.2/48, mean square 0.04/48 = 30.79 dB, texel 6 = (2, 1).
out_has 'similarity     0.995833'
out_has '30.79 dB'
out_has '0.200000 at (2, 1)'
out_has '16 texels x 3 channels'
expect 0 compare a.ppm a.ppm
out_has 'infinite (equal)'
