#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The pictures of docs/splats.md and README: a real scene drawn front to back, the mesh that was made of it, and the same
# with its texture, seen by the same orthographic cameras. Needs the test data. One minute.
# Usage: tools/splat-pictures.sh [FOLDER]      default: docs/images
set -euo pipefail
cd "$(dirname "$0")/.."
programs=$PWD/build/release work=$PWD/build/release/splat-pictures to=${1:-$PWD/docs/images}
data=${POUNCE_TEST_DATA:-$PWD/../shared/data}
for program in pounce pounce-score; do
  [[ -x $programs/$program ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
done
scene=$data/splats/playbot_lod0_sog target=$work/proxy.glb
[[ -e $scene ]] || { echo "needs test data (set POUNCE_TEST_DATA)" >&2; exit 2; }
mkdir -p "$work" "$to"

# What `pounce mesh` makes, with the texture as a file.
"$programs/pounce" proxy "$scene" -o "$target" --triangles 20000 --size 4096 --no-cache --quiet
"$programs/pounce" transfer --redo "$scene" "$target" -o "$work/texture.png" --size 4096 --no-cache --quiet

picture() {  # picture NAME X,Y,Z OPTION...: the camera stands there; the scene lies as PLYs do, -y is up
  "$programs/pounce-score" render "$scene" "$target" "$work/texture.png" --wireframe -o "$work/$1.png" --sh --from "$2" --up 0,-1,0 \
    --size 480 "${@:3}"
  oiiotool "$work/$1.png" --eraseattrib '.*' --nosoftwareattrib --attrib Compression jpeg:85 -o "$to/splats-$1.jpg"
  ls -l "$to/splats-$1.jpg"
}
picture front 0,-0.25,-1 --middle 0,-0.58,0 --edge 1.2
picture side 1,-0.35,0.3
