# SPDX-License-Identifier: Apache-2.0
# inspect says what a splat scene holds and what a transfer would leave out of it; a mesh in a PLY is told from one.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" splats -o scene.ply --count 5000 --sh-degree 1 --broken 2 >"$out"
expect 0 inspect scene.ply
silent "$err"
for text in 'splats' 'gaussians  5000, 4990 usable' '2 not_finite' '2 zero_quaternion' '2 transparent' '2 exploded' '2 far' \
  'degree 1' 'model      default'; do
  out_has "$text"
done
expect 0 inspect scene.ply --json
for text in '"type": "splats"' '"gaussians": 5000' '"usable": 4990' '"far": 2' '"sh_degree": 1' '"middle_box"' '"f_dc_0"'; do
  out_has "$text"
done
head -c 100000 scene.ply >short.ply
expect 3 inspect short.ply
silent "$out"
err_has 'short.ply: cut off'
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nelement face 1\nproperty list uchar int v\nend_header\n' >mesh.ply
expect 3 inspect mesh.ply
err_has 'a mesh (3 vertices, 1 face rows)'
make_job
expect 3 transfer source.obj mesh.ply -o out.png
err_has 'mesh.ply' 'convert a mesh to .glb, .gltf or .obj'
# Half floats are those of splat columns; what another column of two bytes means, only its writer knows.
{
  printf 'ply\nformat binary_little_endian 1.0\nelement vertex 1\n'
  for name in x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2; do
    printf 'property float %s\n' $name
  done
  printf 'property ushort rot_3\nproperty ushort segment\nend_header\n'
  head -c 56 /dev/zero
} >segments.ply
expect 0 inspect segments.ply
out_has 'columns    15 (1 half floats), 56 bytes per Gaussian'
