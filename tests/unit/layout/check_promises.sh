#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The tests and commands that docs/reliability.md names for its promises are there.
# Usage: check_promises.sh SOURCE_DIR BUILD_DIR
set -euo pipefail
page=$1/docs/reliability.md
tests=$(ctest --test-dir "$2" -N | sed -nE 's/^ +Test +#[0-9]+: +//p')
missing=0 count=0
while read -r name; do
  count=$((count + 1))
  # In a name of the page * stands for any name, as in format_*.
  grep -qE "^${name//\*/.*}\$" <<<"$tests" || { echo "docs/reliability.md: there is no test $name"; missing=1; }
done < <(sed -nE '/^\|/p' "$page" | cut -d'|' -f3 | grep -oE '`[a-z_*-]+`' | tr -d '`' | sort -u)
while read -r command; do
  [[ -x $1/$command ]] || { echo "docs/reliability.md: there is no $command"; missing=1; }
done < <(grep -oE 'tools/[a-z-]+\.sh' "$page" | sort -u)
((count >= 20)) || { echo "docs/reliability.md: only $count tests were found on it"; missing=1; }
exit $missing
