# SPDX-License-Identifier: Apache-2.0
# transfer writes the source's colour onto the target, says so on the standard error output, and nothing else.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o o.png
silent "$out"
err_has 'wrote o.png'
err_has '256 texels: 256 covered (100.00 %), 0 empty'
only_files o.png skin.ppm source.mtl source.obj target.obj
expect 0 compare o.png skin.ppm --min-psnr 50
out_has '256 texels x 3 channels'
# The same bytes again, now that the cache is warm, and without one.
expect 0 transfer source.obj target.obj -o again.png -q
silent "$err"
cmp o.png again.png || fail 'a warm cache changes the picture'
expect 0 transfer source.obj target.obj -o none.png -q --no-cache
cmp o.png none.png || fail '--no-cache changes the picture'
