# SPDX-License-Identifier: Apache-2.0
# UVs that repeat an image thousands of times, as one stray coordinate makes them do, are said.
source "$(dirname "$0")/support.sh"
make_job
{ printf 'P6\n256 256\n255\n' && head -c 196608 /dev/zero; } >skin.ppm
expect 0 transfer source.obj target.obj -o o.png --size 16 --plan
! grep -q 'repeat' "$err" || fail 'a warning too many'
sed -i 's/^vt 1 1$/vt 3569 1/' source.obj
expect 0 transfer source.obj target.obj -o o.png --size 16 --plan
err_has 'source.obj: the UVs of material "skin" repeat its baseColor image 1785 times, triangle 1 alone'
err_has '117 million Gaussians'
err_has 'repair stray texture coordinates or leave the material out with --source-material'
