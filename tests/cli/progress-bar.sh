# SPDX-License-Identifier: Apache-2.0
# On a terminal the bar stays on one line, within the width, and is gone at the end.
source "$(dirname "$0")/support.sh"
command -v script >/dev/null || { echo 'SKIPPED: needs script (bsdutils)'; exit 77; }
make_job
TERM=xterm script -qec "stty cols 60; '$POUNCE' transfer source.obj target.obj -o o.png --size 2048" /dev/null \
  </dev/null >"$out"
grep -q $'\r.*%.*\033\[K' "$out" || fail 'no bar'
tr '\r' '\n' <"$out" | sed 's/\x1b\[K//' | awk 'length >= 60 && !/texels/ { exit 1 }' || fail 'wider than the terminal'
tr '\n' '#' <"$out" | grep -qE $'\r\033\[K(pounce: warning|wrote o.png)' || fail 'the bar was not erased'
