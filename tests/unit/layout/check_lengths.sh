#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A file is an idea that is read from top to bottom: none of src/ has more than 500 lines.
# Usage: check_lengths.sh [repository]; prints each file that is longer and exits 1.
set -euo pipefail
cd "${1:-$(dirname "$0")/../../..}"

most=500
longer=$(find src \( -name '*.h' -o -name '*.cpp' -o -name '*.inl' \) -exec awk -v most=$most \
  'FNR == most + 1 { print FILENAME ": more than " most " lines; cut it where its ideas part" }' {} +)
[[ -z $longer ]] || { sort <<<"$longer"; exit 1; }
