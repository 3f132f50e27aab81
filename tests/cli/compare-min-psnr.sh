# SPDX-License-Identifier: Apache-2.0
# --min-psnr: exit status 1 below, 0 at and above; the result is printed either way.
source "$(dirname "$0")/support.sh"
image a.ppm 4 4 100 100 100
image b.ppm 4 4 151 151 151 # off by 0.2: 13.979 dB
expect 0 compare a.ppm b.ppm --min-psnr 13.97
expect 1 compare a.ppm b.ppm --min-psnr 13.99
out_has '13.98 dB'
err_has 'below the required 13.99 dB'
expect 0 compare a.ppm a.ppm --min-psnr 1000
for value in -1 nan loud; do
  expect 2 compare a.ppm b.ppm --min-psnr "$value"
  err_has '--min-psnr: got'
done
