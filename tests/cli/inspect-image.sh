# SPDX-License-Identifier: Apache-2.0
# inspect says size, channels, sample type and format of an image, whatever its name.
source "$(dirname "$0")/support.sh"
image skin.ppm 5 3 1 2 3
cp skin.ppm nameless
for name in skin.ppm nameless; do
  expect 0 inspect $name
  out_has '5 x 3, 3 channels, u8'
done
expect 0 inspect skin.ppm --json
for text in '"type": "image"' '"width": 5' '"height": 3' '"channels": 3' '"depth": "u8"' '"alpha": false'; do
  out_has "$text"
done
