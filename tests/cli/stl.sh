# SPDX-License-Identifier: Apache-2.0
# An STL is a source for what needs no UVs, and no target.
source "$(dirname "$0")/support.sh"
make_job
facet() { printf 'facet normal 0 0 0\nouter loop\nvertex %s\nvertex %s\nvertex %s\nendloop\nendfacet\n' "$@"; }
{
  echo 'solid square'
  facet '0 0 0' '1 0 0' '1 1 0'
  facet '0 0 0' '1 1 0' '0 1 0'
  echo 'endsolid square'
} >m.stl
expect 0 inspect m.stl
out_has 'triangles  2'
out_has 'vertices   4'
out_has 'uv sets    none'
out_has '"square"'
expect 0 transfer source.obj target.obj -o obj.png --bake normal --size 16
expect 0 transfer m.stl target.obj -o stl.png --bake normal --size 16
same_picture obj.png stl.png || fail 'an STL gives other normals than the same OBJ'
expect 3 transfer source.obj m.stl -o o.png
err_has 'm.stl'
grep -qi 'uv' "$err" || fail 'the message does not speak of UVs'
