#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A splat scene far larger than its budget: 50 million Gaussians, as a PLY of degree 3 (12 GB), read where it is, and as an SPZ,
# which is unpacked first, onto 4096² in 512 MiB, measured from outside; then as many of which most are needles, as in captures,
# without harmonics, from around. Of each the same bytes at one and two threads. Needs 30 GB of disk and about an hour.
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
baseline=$(rss_kib "$pounce" transfer --redo "$work/one.ply" "$work/one_target.glb" -o "$work/one.png" --size 1 --no-cache)
limit=$((baseline + 512 * 1024 * 105 / 100 + 16 * 1024))
cp "$work/one_target.glb" "$work/target.glb"

job() {  # job SCENE LOOK
  local scene=$1 kind=${1##*.}-$2 look=$2 threads peak started
  ls -l "$scene"
  for threads in 1 2; do
    started=$SECONDS
    peak=$(rss_kib "$pounce" transfer --redo "$scene" "$work/target.glb" -o "$work/$kind-$threads.png" --size 4096 \
      --look "$look" --memory 512MiB --max-temp 30GiB --threads $threads --no-cache --report "$work/$kind-$threads.json")
    check "$kind: peak at $threads threads: $((peak / 1024)) MiB, limit $((limit / 1024)) MiB, $((SECONDS - started)) s" \
      test "$peak" -le "$limit"
    sed -n 's/^ *"\(covered\|empty\)": \([0-9]*\).*/        \1 \2/p' "$work/$kind-$threads.json"
  done
  check "$kind: the same bytes at 1 and 2 threads" cmp -s "$work/$kind-1.png" "$work/$kind-2.png"
  rm -f "$scene"
}
for kind in ply spz; do
  "$fixture" splats -o "$work/scene.$kind" --count "$count" --sh-degree 3 >/dev/null
  job "$work/scene.$kind" normal
done
"$fixture" splats -o "$work/scene.ply" --count "$count" --needles 0.9 --haze 0.0001 >/dev/null
job "$work/scene.ply" around
# Two files of one scene: what SPZ rounds is to be seen, and nothing else.
psnr=$("$pounce" compare "$work/spz-normal-1.png" "$work/ply-normal-1.png" | grep -o '[0-9.]* dB' | head -n1 | cut -d' ' -f1)
check "SPZ and PLY alike: ${psnr:-equal} dB, at least 30" awk -v p="${psnr:-99}" 'BEGIN { exit !(p >= 30) }'
echo "$failures failed"
[[ $failures -eq 0 ]]
