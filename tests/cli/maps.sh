# SPDX-License-Identifier: Apache-2.0
# maps writes position, normal and mask of a mesh over its UVs.
source "$(dirname "$0")/support.sh"
quad target
expect 0 maps target.obj -o '<CHANNEL>.exr' --size 4x4
silent "$out"
only_files mask.exr normal.exr position.exr target.obj
for name in position normal mask; do
  expect 0 inspect $name.exr
  out_has '4 x 4'
done
# The square's normal is +z everywhere and every texel is covered.
image normal.ppm 4 4 0 0 255
expect 0 compare normal.exr normal.ppm --min-psnr 60
expect 0 maps target.obj -o '<CHANNEL>.exr' --size 4 --report - -q
out_has '"texels": 16'
