# SPDX-License-Identifier: Apache-2.0
# A source without a triangle that has an area is exit 3 and says so.
source "$(dirname "$0")/support.sh"
make_job
{ grep -v '^f' source.obj && echo 'f 1/1 1/2 2/3' && echo 'f 3/3 3/3 3/4'; } >flat.obj
expect 3 transfer flat.obj target.obj -o o.png
err_has 'flat.obj: all of its 2 triangles are degenerate (no area)'
expect 3 transfer flat.obj target.obj -o o.png --plan
echo 'f 1/1 2/2 3/3' >>flat.obj
expect 0 transfer flat.obj target.obj -o o.png -q
