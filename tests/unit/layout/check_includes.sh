#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Keeps the arrows between the rooms one-way and foreign libraries in their place.
# Usage: check_includes.sh [repository]; prints each line that breaks a rule and exits 1.
set -euo pipefail
cd "${1:-$(dirname "$0")/../../..}"

# What each room may include besides itself and the public headers. Only flow/ knows every stage; grid and
# projection know the records they work on (patches, Gaussians, texels), not how those come to be.
declare -A may_include=(
  [core]="" [runtime]="core" [mesh]="core" [store]="core mesh" [io]="core mesh store"
  [surface]="core mesh store" [gaussian]="core mesh store" [shading]="core mesh store"
  [grid]="core mesh store surface gaussian" [projection]="core mesh store surface gaussian grid"
  [views]="core mesh store surface gaussian grid projection"
  [unwrap]="core" [meshing]="core mesh views"
  [sorting]="core runtime mesh store gaussian job" [commands]="core mesh store io" [job]="core runtime store io" [options]="core mesh io"
  [planning]="core mesh store io options surface gaussian shading projection views job"
  [outcome]="core mesh store gaussian projection planning"
  [flow]="sorting outcome planning job core runtime mesh store io options surface gaussian shading grid projection views meshing unwrap"
)
# The same within rooms that have folders: what each may include besides itself and what lies above it.
declare -A may_include_within=(
  [store/pack]="" [store/blocks]="pack" [store/cache]="pack"
  [io/files]="" [io/json]="" [io/codec]="files" [io/foreign]="files codec"
  [io/sandbox]="files codec foreign" [io/image]="files codec sandbox" [io/gltf]="files json" [io/obj]="files" [io/splats]="files json gltf ply"
  [io/model]="files json gltf" [io/ply]="files obj" [io/stl]="files obj ply"
  [flow/stores]="" [flow/shape]="stores" [flow/project]="stores" [flow/sources]="stores project" [flow/write]="stores project"
)
broken=0
complain() {
  echo "$1"
  broken=1
}

for folder in src/*/; do
  room=$(basename "$folder")
  if [[ -z ${may_include[$room]+known} ]]; then
    complain "src/$room: a room without a line in tests/unit/layout/check_includes.sh"
    continue
  fi
  while IFS=: read -r file line text; do
    other=${text#*\"} other=${other%%/*}
    [[ " $room pounce ${may_include[$room]} " == *" $other "* ]] ||
      complain "$file:$line: $room/ must not include $other/"
  done < <(grep -rnE '^#include "[^"]+/' "$folder")
done

for folder in src/{store,io,flow}/*/; do
  [[ -d $folder ]] || continue
  inner=${folder#src/} inner=${inner%/} room=${folder#src/} room=${room%%/*}
  if [[ -z ${may_include_within[$inner]+known} ]]; then
    complain "src/$inner: a folder without a line in tests/unit/layout/check_includes.sh"
    continue
  fi
  if [[ $room == flow ]]; then  # the jobs lie on top of their stages
    while IFS=: read -r file line text; do
      complain "$file:$line: ${inner#*/}/ must not include ${text#*\"}"
    done < <(grep -rnE '^#include "flow/[^"/]+"' "$folder")
  fi
  while IFS=: read -r file line text; do
    other=${text#*\"$room/} other=${other%%/*}
    [[ " ${inner#*/} ${may_include_within[$inner]} " == *" $other "* ]] ||
      complain "$file:$line: $inner/ must not include $room/$other/"
  done < <(grep -rnE "^#include \"$room/[^\"]+/" "$folder")
done

file_libraries='OpenImageIO|OpenColorIO|OpenEXR|tiny_gltf|stb_image|png\.h|jpeglib|tiffio|webp/|draco/|meshoptimizer'
while IFS=: read -r file line _; do
  complain "$file:$line: only the module (src/io/foreign/) includes OpenImageIO and OpenColorIO"
done < <(grep -rnE '^#include <Open(ImageIO|ColorIO)/' src tools bench 2>/dev/null | grep -v '^src/io/foreign/' || true)

while IFS=: read -r file line _; do
  complain "$file:$line: only src/io/ includes image and mesh libraries"
done < <(grep -rnE "^#include [<\"]($file_libraries)" src tools bench 2>/dev/null | grep -vE '^(src/io/|src/meshing/surface.cpp:.*meshoptimizer|bench/embree_program.cpp:.*png)' || true)

while IFS=: read -r file line _; do
  complain "$file:$line: only src/unwrap/flatten.cpp and src/meshing/fit.cpp include Eigen"
done < <(grep -rnE '^#include <(Eigen|unsupported)/' src tools bench 2>/dev/null | grep -vE '^src/(unwrap/flatten|meshing/fit).cpp:' || true)

while IFS=: read -r file line text; do
  complain "$file:$line: a public header includes only the standard library and pounce/"
done < <(grep -rnE '^#include' include/pounce | grep -vE '#include (<[a-z_]+>|"pounce/[a-z_]+\.h")$' || true)

exit $broken
