# SPDX-License-Identifier: Apache-2.0
# A target that was exported with other axes meets its source when it is turned, or the source is.
source "$(dirname "$0")/support.sh"
image skin.ppm 16 16 200 100 50
quad source skin.ppm
# y and z changed places, and z looks the other way: (x, y, z) became (x, -z, y).
sed -E 's/^v ([^ ]+) ([^ ]+) ([^ ]+)/v \1 -\3 \2/' source.obj | sed 's/usemtl.*//' >turned.obj
expect 0 transfer source.obj turned.obj -o missed.png --max-angle 30
err_has 'no texel found a source'
expect 0 transfer source.obj turned.obj -o target.png --target-axes x,z,-y
expect 0 compare target.png skin.ppm --min-psnr 99
expect 0 transfer source.obj turned.obj -o source.png --source-axes x,-z,y
expect 0 compare source.png skin.ppm --min-psnr 99
# Mirrored: the square lies at x = -1..0, and its outside stays outside.
sed -E 's/^v ([^ ]+)/v -\1/' source.obj | sed 's/usemtl.*//' >mirrored.obj
sed -i 's/^f .*/f 4\/4 3\/3 2\/2 1\/1/' mirrored.obj
expect 0 transfer source.obj mirrored.obj -o mirrored.png --target-axes=-x,y,z
expect 0 compare mirrored.png skin.ppm --min-psnr 99
