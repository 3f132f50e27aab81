# SPDX-License-Identifier: Apache-2.0
# Source triangles without UVs are plain surface, with a warning; a source without any is exit 3.
source "$(dirname "$0")/support.sh"
make_job
{
  cat source.obj
  printf 'v 0 0 -1\nv 1 0 -1\nv 1 1 -1\nf -3 -2 -1\n'
} >partly.obj
expect 0 transfer partly.obj target.obj -o o.png
err_has 'partly.obj: 1 triangles have no UVs'
expect 0 transfer source.obj target.obj -o plain.png
same_picture o.png plain.png || fail 'a triangle far behind changed the picture'
quad_without_uvs bare
expect 3 transfer bare.obj target.obj -o p.png --source-texture baseColor=skin.ppm
err_has 'bare.obj: has no UVs'
