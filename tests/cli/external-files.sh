# SPDX-License-Identifier: Apache-2.0
# What a mesh file names outside of its own folder is not read, and above all not copied into the
# output, unless --allow-external says so.
source "$(dirname "$0")/support.sh"
make_job
mkdir -p model/textures secret
image secret/skin.ppm 16 16 1 2 3
cp skin.ppm model/skin.ppm
cp skin.ppm model/textures/skin.ppm

# gltf FILE IMAGE-URI [BUFFER-URI]: a textured triangle.
gltf() {
  printf '{"asset":{"version":"2.0"},"buffers":[{"uri":"%s","byteLength":60}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
"images":[{"uri":"%s"}],"textures":[{"source":0}],
"materials":[{"name":"skin","normalTexture":{"index":0},"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}]}' "${3-mesh.bin}" "$2" >"$1"
}
# Floats 0 and 1 are 00000000 and 0000803f.
bytes() { for word in "$@"; do if ((word)); then printf '\0\0\200\077'; else printf '\0\0\0\0'; fi; done; }
bytes 0 0 0 1 0 0 0 1 0 0 0 1 0 0 1 >model/mesh.bin
cp model/mesh.bin secret/mesh.bin

# Inside of the folder, however it is spelled.
ln -s skin.ppm model/link.ppm
for uri in skin.ppm ./skin.ppm textures/skin.ppm textures/../skin.ppm ../model/skin.ppm %2e%2e/model/skin.ppm link.ppm "$PWD/model/skin.ppm"; do
  gltf model/m.gltf "$uri"
  expect 0 transfer model/m.gltf target.obj -o o.png
done
# The mesh or its folder may be reached through a link.
gltf model/m.gltf skin.ppm
ln -s model/m.gltf linked.gltf
ln -s model linked
for mesh in linked/m.gltf "$PWD/linked/m.gltf" linked/../model/m.gltf; do
  expect 0 transfer "$mesh" target.obj -o o.png
done
mkdir links && ln -s ../model/m.gltf ../model/mesh.bin ../model/skin.ppm links/
expect 0 transfer links/m.gltf target.obj -o o.png
rm o.png

# Outside of it.
ln -s ../secret/skin.ppm model/away.ppm
ln -s ../secret model/away
absolute=$PWD/secret/skin.ppm
for uri in ../secret/skin.ppm ..%2fsecret%2Fskin.ppm %2e%2e/secret/skin.ppm textures/../../secret/skin.ppm away.ppm \
  away/skin.ppm "$absolute" "%2f${absolute#/}" ../model/../secret/skin.ppm; do
  gltf model/m.gltf "$uri"
  expect 3 transfer model/m.gltf target.obj -o o.png
  err_has 'lies outside of the folder of the mesh; --allow-external lets it be read'
  # As a target the model would be given away with it.
  for output in o.gltf o.glb; do
    expect 3 transfer source.obj model/m.gltf -o "$output"
    err_has '--allow-external'
  done
  expect 0 inspect model/m.gltf
  out_has 'problem: the file lies outside of the folder of the mesh'
  expect 0 transfer model/m.gltf target.obj -o o.png --allow-external
  expect 0 inspect model/m.gltf --allow-external
  out_has '16 x 16'
  rm o.png
  [[ -z $(ls | grep '^o\.' || true) ]] || fail "files were made: $(ls)"
done
# What is no name of a file on this system is not there, or no file at all.
for uri in '..\\..\\secret\\skin.ppm' 'file:/etc/passwd'; do
  gltf model/m.gltf "$uri"
  expect 5 transfer model/m.gltf target.obj -o o.png
done
gltf model/m.gltf 'file:///etc/passwd'
expect 3 transfer model/m.gltf target.obj -o o.png

# Buffers.
gltf model/m.gltf skin.ppm ../secret/mesh.bin
expect 3 transfer model/m.gltf target.obj -o o.png
err_has 'buffer 0 is the file "../secret/mesh.bin", which lies outside of the folder of the mesh'
expect 3 transfer source.obj model/m.gltf -o o.png
expect 3 maps model/m.gltf -o 'o.<CHANNEL>.exr' --size 16
expect 3 gaussians model/m.gltf -o o.ply
[[ -z $(ls | grep '^o\.' || true) ]] || fail "files were made: $(ls)"
expect 0 maps model/m.gltf -o 'o.<CHANNEL>.exr' --size 16 --allow-external
expect 0 gaussians model/m.gltf -o o.ply --allow-external
expect 0 transfer source.obj model/m.gltf -o o.glb --allow-external
rm o.*

# OBJ: the material file, its images, sets of them.
mv model/skin.ppm beside.ppm
quad model/q ../secret/skin.ppm
sed -i 's,mtllib model/,mtllib ,' model/q.obj
expect 3 transfer model/q.obj target.obj -o o.png
err_has '--allow-external'
expect 0 transfer model/q.obj target.obj -o o.png --allow-external
rm o.png
cp model/q.mtl secret/q.mtl
sed -i 's,mtllib q.mtl,mtllib ../secret/q.mtl,' model/q.obj
expect 3 transfer model/q.obj target.obj -o o.png
err_has 'its material file model/../secret/q.mtl lies outside of the folder of the mesh; --allow-external lets it be read'
expect 0 transfer model/q.obj target.obj -o o.png --allow-external
rm o.png
sed -i "s,mtllib .*,mtllib q.mtl," model/q.obj
# Absolute paths of the machine that it was made on: the file beside is taken, if there is one.
printf 'newmtl skin\nmap_Kd %s\n' "$absolute" >model/q.mtl
expect 3 transfer model/q.obj target.obj -o o.png
err_has '--allow-external'
mv beside.ppm model/skin.ppm
expect 0 transfer model/q.obj target.obj -o o.png
# A material file of a folder below may name what lies beside that folder.
mkdir model/materials
printf 'newmtl skin\nmap_Kd ../textures/skin.ppm\n' >model/materials/q.mtl
sed -i 's,mtllib .*,mtllib materials/q.mtl,' model/q.obj
expect 0 transfer model/q.obj target.obj -o o.png
