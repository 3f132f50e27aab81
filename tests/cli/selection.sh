# SPDX-License-Identifier: Apache-2.0
# Parts of a mesh by name, another UV set, other axes.
source "$(dirname "$0")/support.sh"
rejected --target-uv-set -1 x 256
rejected --source-axes x x,y x,y,y x,y,z,x x,,y x,y,-
refused '--source-mesh: got ""' transfer a.obj b.obj -o o.png --source-mesh ''

image left.ppm 4 4 200 0 0
image right.ppm 4 4 0 200 0
# Two squares beside each other, in the same place of the texture.
cat >both.obj <<'OBJ'
mtllib both.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
v 3 0 0
v 3 1 0
v 2 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
o Left
usemtl red
f 1/1 2/2 3/3 4/4
o Right
usemtl green
f 5/1 6/2 7/3 8/4
OBJ
printf 'newmtl red\nmap_Kd left.ppm\nnewmtl green\nmap_Kd right.ppm\n' >both.mtl

expect 0 transfer both.obj both.obj -o left.png --target-mesh Left
expect 0 transfer both.obj both.obj -o right.png --target-material 'gr*n'
expect 0 compare left.png left.ppm --min-psnr 99
expect 0 compare right.png right.ppm --min-psnr 99
expect 0 transfer both.obj both.obj -o none.png --target-mesh Left --source-mesh 'R*'
err_has 'no texel found a source'

expect 3 transfer both.obj both.obj -o o.png --target-mesh lefft
err_has 'both.obj: --target-mesh lefft: matches nothing; available are "Left", "Right"; did you mean "Left"?'
expect 3 transfer both.obj both.obj -o o.png --source-material blue
err_has '--source-material blue: matches nothing; available are "red", "green"'
expect 3 transfer both.obj both.obj -o o.png --source-material '[gr]'
err_has '--source-material [gr]: matches nothing'
expect 3 transfer both.obj both.obj -o o.png --target-uv-set 1
err_has 'both.obj: --target-uv-set 1: no such UV set; the mesh has 1, number 0'
expect 3 transfer both.obj both.obj -o o.png --source-uv-set 7
err_has '--source-uv-set 7'
expect 3 maps both.obj -o '<CHANNEL>.exr' --size 4 --target-mesh Middle
err_has '--target-mesh Middle'
[[ ! -e o.png ]] || fail 'something was written'
# --source-uv-set also serves a texture whose own UV set is not there.
{
  printf '\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0'
  printf '\0\0\0\0\0\0\x80\x3f\0\0\x80\x3f\0\0\x80\x3f\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\0\0'
  printf '\0\0\1\0\2\0\0\0\2\0\3\0'
} >lost.bin
cat >lost.gltf <<'END'
{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2,"material":0}]}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"texCoord":2}}}],
"textures":[{"source":0}],"images":[{"uri":"left.png"}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":32},{"buffer":0,"byteOffset":80,"byteLength":12}],
"buffers":[{"uri":"lost.bin","byteLength":92}]}
END
expect 3 transfer lost.gltf both.obj -o lost.png --target-mesh Left
expect 0 transfer lost.gltf both.obj -o lost.png --target-mesh Left --source-uv-set 0
expect 0 compare lost.png left.ppm --min-psnr 99
