#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A splat scene far larger than its budget: 50 million Gaussians (12 GB) onto 4096² in 512 MiB, measured from outside, the
# same bytes at one and two threads. Needs 20 GB of disk and ten minutes.
# Usage: tools/slow-splats.sh [COUNT]
set -euo pipefail
cd "$(dirname "$0")/.."
count=${1:-50000000}
pounce=$PWD/build/release/pounce fixture=$PWD/build/release/pounce-fixture work=$PWD/build/release/slow-splats
[[ -x $pounce && -x $fixture ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
mkdir -p "$work"

failures=0
check() {  # check WHAT CONDITION...
  local what=$1
  shift
  if "$@"; then echo "ok      $what"; else echo "FAILED  $what"; failures=$((failures + 1)); fi
}
rss_kib() { /usr/bin/time -o "$work/time" -f %M "$@" >"$work/log" 2>&1 || { cat "$work/log" >&2; return 1; }; tail -n1 "$work/time"; }

# The smallest job of these formats is a scene of one Gaussian.
"$fixture" splats -o "$work/one.ply" --count 1 --target-size 16 >/dev/null
baseline=$(rss_kib "$pounce" transfer "$work/one.ply" "$work/one_target.glb" -o "$work/one.png" --size 1 --no-cache)
limit=$((baseline + 512 * 1024 * 105 / 100 + 16 * 1024))
"$fixture" splats -o "$work/scene.ply" --count "$count" --sh-degree 3 >/dev/null
cp "$work/one_target.glb" "$work/target.glb"
ls -l "$work/scene.ply"
for threads in 1 2; do
  peak=$(rss_kib "$pounce" transfer "$work/scene.ply" "$work/target.glb" -o "$work/$threads.png" --size 4096 \
    --memory 512MiB --threads $threads --no-cache --report "$work/$threads.json")
  check "peak at $threads threads: $((peak / 1024)) MiB, limit $((limit / 1024)) MiB" test "$peak" -le "$limit"
  sed -n 's/^ *"\(covered\|empty\)": \([0-9]*\).*/        \1 \2/p' "$work/$threads.json"
done
check "the same bytes at 1 and 2 threads" cmp -s "$work/1.png" "$work/2.png"
rm -f "$work/scene.ply"
echo "$failures failed"
[[ $failures -eq 0 ]]
