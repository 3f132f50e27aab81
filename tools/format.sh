#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Names the C++ files that are not as clang-format 14 would write them and exits 1; with --fix rewrites them.
# Usage: tools/format.sh [--fix] [FILE...]      default: every file under version control
set -euo pipefail
cd "$(dirname "$0")/.."

how=(--dry-run -Werror)
if [[ ${1-} == --fix ]]; then
  how=(-i)
  shift
fi
if (($#)); then
  files=("$@")
else
  mapfile -t files < <(git ls-files '*.h' '*.cpp' '*.inl')
fi
there=()
for file in "${files[@]}"; do
  [[ ! -f $file ]] || there+=("$file") # deleted and not committed yet
done
((${#there[@]})) || exit 0
said=$(clang-format "${how[@]}" "${there[@]}" 2>&1) && exit 0
printf '%s\n' "$said" | sed -nE 's/^([^:]+):[0-9]+:[0-9]+: error.*/not formatted: \1/p' | sort -u
echo "run tools/format.sh --fix"
exit 1
