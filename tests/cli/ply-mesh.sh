# SPDX-License-Identifier: Apache-2.0
# A PLY with faces is a mesh, as source and as target; without UVs it is no target.
source "$(dirname "$0")/support.sh"
make_job
# ply NAME COMMENT COLUMNS ROW...: a square whose rows have these columns behind x y z.
ply() {
  local name=$1 comment=$2 columns=$3
  shift 3
  {
    printf 'ply\nformat ascii 1.0\n'
    [[ -z $comment ]] || printf 'comment %s\n' "$comment"
    printf 'element vertex 4\nproperty float x\nproperty float y\nproperty float z\n'
    printf "$columns"
    printf 'element face 1\nproperty list uchar int vertex_indices\nend_header\n'
    printf '%s\n' "$@" '4 0 1 2 3'
  } >"$name.ply"
}
uv='property float s\nproperty float t\n'
ply skinned 'TextureFile skin.ppm' "$uv" '0 0 0 0 0' '1 0 0 1 0' '1 1 0 1 1' '0 1 0 0 1'
ply bare '' '' '0 0 0' '1 0 0' '1 1 0' '0 1 0'

expect 0 transfer source.obj target.obj -o obj.png --size 16
expect 0 transfer skinned.ply target.obj -o source.png --size 16
same_picture obj.png source.png || fail 'as a source a PLY gives another picture than the same OBJ'
expect 0 transfer source.obj skinned.ply -o target.png --size 16
same_picture obj.png target.png || fail 'as a target a PLY gives another picture than the same OBJ'
expect 3 transfer source.obj bare.ply -o o.png
err_has 'bare.ply'
grep -qi 'uv' "$err" || fail 'the message does not speak of UVs'
expect 2 transfer source.obj skinned.ply -o model.glb
err_has 'a model can only be written from a .glb or .gltf target'

expect 0 inspect skinned.ply
out_has 'triangles  2'
out_has 'u 0 to 1'
out_has 'skin.ppm'
expect 0 inspect skinned.ply --json
out_has '"type": "mesh"'

# A texture from elsewhere has to be allowed.
mkdir inner
cp skinned.ply inner/m.ply
sed -i 's|TextureFile skin.ppm|TextureFile ../skin.ppm|' inner/m.ply
expect 3 transfer inner/m.ply target.obj -o o.png --size 16
err_has '--allow-external'
expect 0 transfer inner/m.ply target.obj -o outer.png --size 16 --allow-external
same_picture obj.png outer.png || fail 'a texture from elsewhere gives another picture'
