#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing, builds the preset `release` and runs the benchmarks, five times each.
# Usage: tools/bench.sh [RESULT.json] [pounce_bench arguments, e.g. --benchmark_filter=search]
#        tools/bench.sh table [bench/table.py arguments, e.g. --parts heads,maps --sizes 1024,4096 --check]
# With "table": whole processes, in parts, each one interleaved run: pounce beside an Embree program and Blender where
# it is installed, splats, maps, materials, UDIMs, instruction sets, budgets, formats. bench/table.py --help lists what
# can be chosen, bench/README.md what is measured. All of it takes half an hour and 2 GiB in TMPDIR.
# Without "table" it takes three minutes on a quiet machine. Compare two results of either kind with bench/compare.py.
set -euo pipefail
cd "$(dirname "$0")/.."

if [[ ${1-} == table ]]; then
  shift
  tools/install-packages.sh
  if ! dpkg-query -W libembree-dev >/dev/null 2>&1; then
    echo "== Installing libembree-dev, for the benchmark alone"
    apt-get install -y --no-install-recommends libembree-dev >/dev/null
  fi
  cmake --preset release -DPOUNCE_BUILD_BENCH=ON >/dev/null
  cmake --build --preset release --target pounce_cli pounce-fixture pounce_embree
  blender=$(command -v blender || true)
  bench/table.py --programs build/release --json build/release/table.json ${blender:+--blender "$blender"} "$@"
  echo "results: build/release/table.json"
  exit
fi
result=build/release/bench.json
if [[ $# -gt 0 && $1 != -* ]]; then
  result=$1
  shift
fi
tools/install-packages.sh
echo "== Building (preset release)"
cmake --preset release -DPOUNCE_BUILD_BENCH=ON
cmake --build --preset release --target pounce_bench

commit=$(git rev-parse --short HEAD 2>/dev/null || echo unknown)
if ! git diff --quiet HEAD -- src 2>/dev/null; then commit+="+changes"; fi
echo "== Running ($commit)"
build/release/pounce_bench --benchmark_repetitions=5 --benchmark_min_time=0.05 \
  --benchmark_enable_random_interleaving=true --benchmark_display_aggregates_only=true \
  --benchmark_context=commit="$commit" \
  --benchmark_context=processor="$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)" \
  --benchmark_out="$result" --benchmark_out_format=json "$@"

echo "== Times faster than the method done literally (1024², everything but files)"
# A --benchmark_filter may have left these out.
bench/compare.py "$result" --ratio literal_same/1024:per_texel \
  transfer_in_core/same/1024/threads:1:kernel || true
echo "results: $result"
