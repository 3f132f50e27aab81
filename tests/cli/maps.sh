# SPDX-License-Identifier: Apache-2.0
# maps writes position, normal and mask of a mesh over its UVs.
source "$(dirname "$0")/support.sh"
quad target
expect 0 maps target.obj -o '<CHANNEL>.exr' --size 4x4
silent "$out"
only_files mask.exr normal.exr position.exr target.obj
for name in position normal mask; do
  expect 0 inspect $name.exr
  out_has '4 x 4'
done
# The square's normal is +z everywhere and every texel is covered.
image normal.ppm 4 4 0 0 255
expect 0 compare normal.exr normal.ppm --min-psnr 60
expect 0 maps target.obj -o '<CHANNEL>.exr' --size 4 --report - -q
out_has '"texels": 16'
# With <UDIM> every tile has its maps: those of its own triangles.
sed 's/^v \([01]\)/v 2\1/' target.obj >far.obj
expect 0 maps far.obj -o 'far.<CHANNEL>.exr' --size 4
{ cat target.obj && grep '^v ' far.obj && printf 'vt 1 1\nvt 2 1\nvt 2 2\nvt 1 2\nf 5/5 6/6 7/7 8/8\n'; } >two.obj
expect 0 maps two.obj -o '<UDIM>.<CHANNEL>.exr' --size 4
same_picture 1001.position.exr position.exr || fail 'the first tile is another picture'
same_picture 1012.position.exr far.position.exr || fail 'the second tile is another picture'
same_picture 1012.mask.exr far.mask.exr || fail 'the second tile has another mask'
expect 2 maps target.obj -o '<CHANNEL>.png'
err_has 'error: position.png: positions and normals need'
