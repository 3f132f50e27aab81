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
bad=()
for file in "${files[@]}"; do
  [[ -f $file ]] || continue # deleted and not committed yet
  clang-format "${how[@]}" "$file" 2>/dev/null || bad+=("$file")
done
if ((${#bad[@]})); then
  printf 'not formatted: %s\n' "${bad[@]}"
  echo "run tools/format.sh --fix"
  exit 1
fi
