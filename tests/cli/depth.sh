# SPDX-License-Identifier: Apache-2.0
# --depth picks the sample type; what the format cannot hold is a usage error that names it.
source "$(dirname "$0")/support.sh"
make_job
for pair in u8:png u16:png u8:tif u16:tif float:tif half:exr float:exr; do
  name=${pair%%:*}.${pair##*:}
  expect 0 transfer source.obj target.obj -o "$name" --depth "${pair%%:*}"
  expect 0 inspect "$name" --json
  out_has "\"depth\": \"${pair%%:*}\""
done
expect 0 compare u16.png u8.png --min-psnr 45
# A format that cannot hold it is named once.
expect 2 transfer source.obj target.obj -o o.png --depth half
err_has 'error: o.png: this format supports'
expect 2 transfer source.obj target.obj -o o.tif --coverage mask.jpg --size 65501x1
err_has 'error: mask.jpg: 65501'
