#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Other people's programs that tests compare with, pinned, from npm into FOLDER (needs node, npm and a network):
# Khronos' glTF validator, the reference of MikkTSpace's tangents, and Basis Universal: its transcoder for
# tools/ktx2-to-png.cjs, and its encoder for the test of that.
#   install-oracles.sh FOLDER     does nothing where all are there already
# Where npm is missing it says so and ends with 0; the tests that need them are then skipped.
set -euo pipefail
folder=${1:?folder}
packages=(gltf-validator@2.0.0-dev.3.10 mikktspace@1.1.1 three@0.187.0 ktx2-encoder@0.6.0)

if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
  echo "SKIPPED: the glTF validator, mikktspace, three and ktx2-encoder (need node and npm)"
  exit 0
fi
missing=no
for package in "${packages[@]}"; do
  installed=$folder/node_modules/${package%@*}/package.json
  grep -qs "\"version\": *\"${package#*@}\"" "$installed" || missing=yes
done
[[ $missing == no ]] || npm install --silent --no-audit --no-fund --prefix "$folder" "${packages[@]}"
