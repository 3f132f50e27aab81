#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Keeps the arrows between the rooms one-way and foreign libraries in their place.
# Usage: check_includes.sh [repository]; prints each line that breaks a rule and exits 1.
set -euo pipefail
cd "${1:-$(dirname "$0")/../../..}"

# What each room may include besides itself and the public headers. Only flow/ knows every stage; grid and
# projection know the records they work on (source patches, target texels), not how those come to be.
declare -A may_include=(
  [core]="" [mesh]="core" [tiles]="core mesh" [io]="core mesh tiles"
  [source]="core mesh tiles" [target]="core mesh tiles" [texture]="core mesh tiles"
  [grid]="core mesh tiles source" [projection]="core mesh tiles source target grid"
  [flow]="core mesh tiles io source target texture grid projection"
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
    other=$(sed -E 's|^#include "([^/"]*)/.*|\1|' <<<"$text")
    [[ " $room pounce ${may_include[$room]} " == *" $other "* ]] ||
      complain "$file:$line: $room/ must not include $other/"
  done < <(grep -rnE '^#include "[^"]+/' "$folder")
done

file_libraries='OpenImageIO|tiny_gltf|tiny_obj_loader|stb_image'
while IFS=: read -r file line _; do
  complain "$file:$line: only src/io/ includes image and mesh libraries"
done < <(grep -rnE "^#include [<\"]($file_libraries)" src tools bench 2>/dev/null | grep -v '^src/io/' || true)

while IFS=: read -r file line text; do
  complain "$file:$line: a public header includes only the standard library and pounce/"
done < <(grep -rnE '^#include' include/pounce | grep -vE '#include (<[a-z_]+>|"pounce/[a-z_]+\.h")$' || true)

exit $broken
