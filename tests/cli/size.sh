# SPDX-License-Identifier: Apache-2.0
# --size takes N or WxH, 1 to 65536 texels.
source "$(dirname "$0")/support.sh"
rejected --size 0 65537 4x
refused '--size: got "0"' maps b.glb -o '<CHANNEL>.exr' --size 0
make_job
expect 0 transfer source.obj target.obj -o o.png --size 8x4 -q
expect 0 inspect o.png
out_has '8 x 4'
