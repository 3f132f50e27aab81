# SPDX-License-Identifier: Apache-2.0
# Two images that would get one name are a usage error before anything is read or written.
source "$(dirname "$0")/support.sh"
make_job
expect 2 transfer source.obj target.obj -o o.png --channels baseColor,emissive \
  --source-texture emissive=skin.ppm
err_has 'o.png'
expect 2 transfer source.obj target.obj -o o.png --coverage o.png
err_has 'o.png'
expect 0 transfer source.obj target.obj -o '<CHANNEL>.png' --source-texture emissive=skin.ppm
only_files baseColor.png emissive.png skin.ppm source.mtl source.obj target.obj
