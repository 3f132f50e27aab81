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
# Two far ones make the whole box; the box of 98 % is the scene's.
{
  printf 'ply\nformat binary_little_endian 1.0\nelement vertex 602\n'
  for name in x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3; do
    printf 'property float %s\n' $name
  done
  printf 'end_header\n'
} >floaters.ply
one='\0\0\200\77' minus='\0\0\200\277' hundred='\0\0\310\102' nothing='\0\0\0\0'
rest=$(for _ in 1 2 3 4 5 6 7; do printf '%s' "$nothing"; done; printf '%s' "$one$nothing$nothing$nothing")
for ((i = 0; i < 300; ++i)); do printf "$one$one$one$rest$minus$minus$minus$rest"; done >>floaters.ply
printf "$hundred$one$one$rest$one$hundred$one$rest" >>floaters.ply
expect 0 inspect floaters.ply
out_has 'box        -1 -1 -1  to  100 100 1'
out_has 'box 98 %   -1 -1 -1  to  1 1 1'
expect 0 inspect floaters.ply --json
out_has '"box_98": {'
head -c 100000 scene.ply >short.ply
expect 3 inspect short.ply
silent "$out"
err_has 'short.ply: truncated'
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
