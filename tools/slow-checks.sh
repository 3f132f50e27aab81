#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The checks that take minutes: a texture of 8192², a target of 16384², a budget of 512 MiB, measured from outside; and 20
# UDIMs of 4096² from 16 of 4096² in 256 MiB; 4096² by --method gaussian in 128 MiB; and 16384² of every format in 64 MiB.
# Run before a release and after every change of the flow; tools/test.sh holds smaller siblings.
# Usage: tools/slow-checks.sh [SOURCE.glb TARGET.glb TEXTURE]   (default: generated, in build/release/slow)
set -euo pipefail
cd "$(dirname "$0")/.."
pounce=$PWD/build/release/pounce fixture=$PWD/build/release/pounce-fixture work=$PWD/build/release/slow
[[ -x $pounce && -x $fixture ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
mkdir -p "$work"

failures=0
check() {  # check WHAT CONDITION...
  local what=$1
  shift
  if "$@"; then echo "ok      $what"; else echo "FAILED  $what"; failures=$((failures + 1)); fi
}
rss_kib() { /usr/bin/time -o "$work/time" -f %M "$@" >"$work/log" 2>&1 || { cat "$work/log" >&2; return 1; }; tail -n1 "$work/time"; }

if [[ $# -eq 3 ]]; then
  source=$1 target=$2 texture=$3
else
  "$fixture" head -o "$work" --texture 8192 --target-size 64 >/dev/null
  source=$work/head_src.glb target=$work/head_other.glb texture=
fi
override=()
[[ -z ${texture:-} ]] || override=(--source-texture "baseColor=$texture")

"$fixture" one-texel -o "$work/one" >/dev/null
one=$(find "$work/one" -name '*.glb' | sort | head -n1)
baseline=$(rss_kib "$pounce" transfer --redo "$one" "$one" -o "$work/one.png" --size 1 --no-cache)
limit=$((baseline + 512 * 1024 * 105 / 100 + 16 * 1024))
echo "baseline $((baseline / 1024)) MiB, limit for 512 MiB: $((limit / 1024)) MiB"

for threads in 1 2; do
  peak=$(rss_kib "$pounce" transfer --redo "$source" "$target" "${override[@]}" -o "$work/$threads.png" --size 16384 \
    --memory 512MiB --threads $threads --no-cache --report "$work/$threads.json")
  check "peak at $threads threads: $((peak / 1024)) MiB" test "$peak" -le "$limit"
  ns=$(python3 - "$work/$threads.json" <<'PY'
import json, sys
report = json.load(open(sys.argv[1]))
cpu = sum(s["cpu_s"] for s in report["stages"] if s["name"] not in ("decode", "encode"))
print(round(cpu / report["target"]["covered"] * 1e9))
PY
)
  check "CPU at $threads threads: $ns ns per covered texel" test "$ns" -le 150
done
rss_kib "$pounce" transfer --redo "$source" "$target" "${override[@]}" -o "$work/3.png" --size 16384 --memory 8GiB \
  --threads 3 --no-cache >/dev/null
check "the same bytes at 1 thread" cmp -s "$work/1.png" "$work/3.png"
check "the same bytes at 2 threads" cmp -s "$work/2.png" "$work/3.png"

# 16 million texels as Gaussians in 128 MiB. Their sort takes 1.4 GB of disk.
"$fixture" head -o "$work/gaussians" --texture 4096 --target-size 64 >/dev/null
limit=$((baseline + 128 * 1024 * 105 / 100 + 16 * 1024))
for memory in 128MiB 4GiB; do
  peak=$(rss_kib "$pounce" transfer --redo "$work/gaussians/head_src.glb" "$work/gaussians/head_src.glb" --method gaussian \
    -o "$work/g.$memory.png" --size 4096 --memory $memory --no-cache)
  [[ $memory != 128MiB ]] ||
    check "peak of --method gaussian at 4096² in 128 MiB: $((peak / 1024)) MiB, limit $((limit / 1024)) MiB" test "$peak" -le "$limit"
done
check "the same bytes in 128 MiB and 4 GiB" cmp -s "$work/g.128MiB.png" "$work/g.4GiB.png"

# 20 UDIMs from 16. What the source costs once is left out of the time per texel.
"$fixture" one-texel -o "$work/one" --mesh-format obj >/dev/null
baseline=$(rss_kib "$pounce" transfer --redo "$work/one/one_texel_src.obj" "$work/one/one_texel_target.obj" -o "$work/one.png" \
  --size 1 --no-cache)
limit=$((baseline + 256 * 1024 * 105 / 100 + 16 * 1024))
mkdir -p "$work/udim"
[[ -e $work/s.1016.png ]] || "$fixture" plane -o "$work/s.obj" --triangles 20000 --uv-tiles 16 --texture 4096 >/dev/null
"$fixture" plane -o "$work/t.obj" --triangles 24000 --uv-tiles 20 >/dev/null
udims() {  # udims NAME OPTION...
  local name=$1
  shift
  rss_kib "$pounce" transfer --redo "$work/s.obj" "$work/t.obj" -o "$work/udim/$name.<UDIM>.png" --size 4096 --memory 256MiB \
    --source-texture "baseColor=$work/s.<UDIM>.png" --no-cache --report "$work/$name.json" "$@"
}
peak=$(udims all)
check "peak of 20 UDIMs in 256 MiB: $((peak / 1024)) MiB, limit $((limit / 1024)) MiB" test "$peak" -le "$limit"
udims single --tiles 1007 >/dev/null
check "one tile alone has the same bytes" cmp -s "$work/udim/all.1007.png" "$work/udim/single.1007.png"
ratio=$(python3 - "$work/all.json" "$work/single.json" <<'PY'
import json, sys
def ns(path):
    report = json.load(open(path))
    stages = sum(s["cpu_s"] for s in report["stages"] if s["name"] not in ("read", "decode", "precondition"))
    return stages / report["target"]["covered"]
print(round(100 * ns(sys.argv[1]) / ns(sys.argv[2])))
PY
)
check "CPU per texel of 20 tiles: $ratio % of one tile's" test "$ratio" -le 130

# 16384² of each format, written and read: 64 MiB above the smallest job of the same formats. An EXR has chunks of 16
# rows, so its least budget is larger. (WebP ends at 16383.)
"$fixture" plane -o "$work/plain.glb" --triangles 2000 --texture 1024 >/dev/null
for format in png jpg tif tx exr; do
  kind=$format budget=48MiB
  [[ $kind != tx ]] || kind=tif
  [[ $kind != exr ]] || budget=60MiB
  "$fixture" one-texel -o "$work/one" --mesh-format obj --image-format $kind >/dev/null
  limit=$(($(rss_kib "$pounce" transfer --redo "$work/one/one_texel_src.obj" "$work/one/one_texel_target.obj" \
    -o "$work/one.$format" --size 1 --no-cache) + 64 * 1024))
  peak=$(rss_kib "$pounce" transfer --redo "$work/plain.glb" "$work/plain.glb" -o "$work/big.$format" --size 16384 --memory $budget \
    --no-cache)
  check "16384² written as $format with $budget: $((peak / 1024)) MiB, limit $((limit / 1024)) MiB" test "$peak" -le "$limit"
  peak=$(rss_kib "$pounce" transfer --redo "$work/plain.glb" "$work/plain.glb" --source-texture "baseColor=$work/big.$format" \
    -o "$work/small.$format" --size 256 --memory $budget --no-cache)
  check "16384² read as $format with $budget: $((peak / 1024)) MiB, limit $((limit / 1024)) MiB" test "$peak" -le "$limit"
  rm -f "$work/big.$format"
done
echo "$failures failed"
[[ $failures -eq 0 ]]
