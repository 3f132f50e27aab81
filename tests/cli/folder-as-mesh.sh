# SPDX-License-Identifier: Apache-2.0
# A folder but a mesh is told to be one, with what may be named instead.
source "$(dirname "$0")/support.sh"
make_job
mkdir folder folder.glb
for mesh in folder folder.glb; do
  for sides in "$mesh target.obj" "source.obj $mesh"; do
    # shellcheck disable=SC2086  # two words
    expect 5 transfer $sides -o o.png
    err_has "$mesh: is a folder; name a mesh in it (.glb, .gltf, .obj, .ply or .stl) or, as a source, a splat scene"
  done
done
