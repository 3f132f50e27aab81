#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# From a fresh clone to pictures: installs what is missing, builds `release`, makes a head and two targets,
# transfers the head's texture onto both, and says where the pictures are.
set -eu
cd "$(dirname "$0")/.."

./tools/install-packages.sh
echo "== Building (preset release)"
cmake --preset release >/dev/null
cmake --build --preset release --target pounce_cli pounce_fixture_cli

demo=build/release/demo
pounce=build/release/pounce
echo "== Making the head and its targets"
build/release/pounce-fixture head -o "$demo" --format both

echo "== Transferring onto the same head with other triangles and UVs"
"$pounce" transfer "$demo/head_src.glb" "$demo/head_same.glb" -o "$demo/onto_same.png" --size 1024
echo "   against the exact answer:"
"$pounce" compare "$demo/onto_same.png" "$demo/head_same.truth.png"

echo "== Transferring onto another head"
"$pounce" transfer "$demo/head_src.glb" "$demo/head_other.glb" -o "$demo/onto_other.png" --size 1024

echo "== The head onto itself"
"$pounce" transfer "$demo/head_src.glb" "$demo/head_src.glb" -o "$demo/onto_itself.png" --size 1024 \
  --coverage "$demo/onto_itself.coverage.png"
"$pounce" compare "$demo/onto_itself.png" "$demo/head_src.png" --mask "$demo/onto_itself.coverage.png"

echo "== A noisy splat scene of the head onto the head"
build/release/pounce-fixture splats -o "$demo/splats.ply" --count 2000000 --target-size 1024
"$pounce" transfer "$demo/splats.ply" "$demo/splats_target.glb" -o "$demo/from_splats.png" --size 1024
"$pounce" compare "$demo/from_splats.png" "$demo/splats_target.truth.png"

echo "== A textured mesh of the same scene, made from nothing but the splats, and back onto the head"
"$pounce" mesh "$demo/splats.ply" -o "$demo/mesh_of_splats.glb" --size 2048
"$pounce" transfer "$demo/mesh_of_splats.glb" "$demo/splats_target.glb" -o "$demo/from_mesh.png" --size 1024
"$pounce" compare "$demo/from_mesh.png" "$demo/splats_target.truth.png"

echo "== Pictures, and a model for any viewer"
for picture in head_src.png onto_same.png head_same.truth.png onto_other.png onto_itself.png \
  from_splats.png from_mesh.png mesh_of_splats.glb; do
  echo "$PWD/$demo/$picture"
done
