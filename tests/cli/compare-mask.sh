# SPDX-License-Identifier: Apache-2.0
# --mask limits the comparison to where the mask's first channel is not 0.
source "$(dirname "$0")/support.sh"
image a.ppm 2 1 10 10 10
image b.ppm 2 1 10 10 10 255 255 255
mask left.pgm 2 1 255 0
mask nothing.pgm 2 1 0 0
expect 0 compare a.ppm b.ppm --mask left.pgm --min-psnr 1000
out_has '1 texels'
expect 3 compare a.ppm b.ppm --mask nothing.pgm
err_has 'nothing.pgm'
image large.ppm 3 1 10 10 10
expect 3 compare a.ppm large.ppm
err_has 'large.ppm'
expect 3 compare a.ppm b.ppm --mask large.ppm
err_has 'large.ppm'
