# SPDX-License-Identifier: Apache-2.0
# compare --json: the same figures for programs; equal images have no finite PSNR, which JSON cannot say.
source "$(dirname "$0")/support.sh"
image a.ppm 4 4 100 100 100
image b.ppm 4 4 151 151 151
expect 0 compare a.ppm a.ppm --json
out_has '"psnr_db": null'
out_has '"equal": true'
expect 1 compare a.ppm b.ppm --json --min-psnr 20
for text in '"similarity": 0.8' '"psnr_db": 13.97' '"equal": false' '"texels": 16' '"channels": 3' '"passed": false'; do
  out_has "$text"
done
