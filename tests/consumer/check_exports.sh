#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A shared libpounce shows the names in exports.txt and no others: what is shown by mistake is what somebody's
# program clashes with, or comes to need.
# Usage: check_exports.sh LIBRARY [NM]
set -euo pipefail
library=$1 nm=${2:-nm}
export LC_ALL=C
shown=$("$nm" --dynamic --defined-only --demangle "$library" | cut -d' ' -f3- | sed -E 's/\(.*//; s/\[abi:[a-z0-9]+\]//' | sort -u)
diff <(grep -v '^#' "$(dirname "$0")/exports.txt") <(printf '%s\n' "$shown") || {
  echo "the lines marked > are exported and not in tests/consumer/exports.txt, those marked < the other way round"
  exit 1
}
