# SPDX-License-Identifier: Apache-2.0
# --size takes N or WxH, 1 to 65536 texels.
source "$(dirname "$0")/support.sh"
rejected --size 0 -1 65537 1x65537 0x4 4x 'x4' 4x4x4 1.5 1e3 '' ' 4' nan 99999999999999999999
refused '--size: got "0"' maps b.glb -o '<CHANNEL>.exr' --size 0
make_job
expect 0 transfer source.obj target.obj -o o.png --size 8x4 -q
expect 0 inspect o.png
out_has '8 x 4'
