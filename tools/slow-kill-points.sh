#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Small jobs of every kind, each killed before every write, sync, link, rename, removal and creation of a file, in the middle
# of every write, and as if the power failed there; and the run that follows killed as well. Then the same command:
# same bytes, nothing left, a sound cache. And each of its calls on a file that fails, once or from there on: the right
# bytes, or the reason; then the same command. A quarter of an hour of two cores.
# Usage: tools/slow-kill-points.sh [OPTION...]   (of tests/kill_points/kill_points.py: --only JOB,... --how before,half,zeros,short)
set -euo pipefail
cd "$(dirname "$0")/.."
build=build/release
[[ -x $build/pounce && -x $build/pounce-fixture ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
driver=(python3 tests/kill_points/kill_points.py "$build/pounce" "$build/pounce-fixture" "$build/tests/kill_points/libkill_point.so"
  -j "$(nproc)")
if [[ $# -gt 0 ]]; then exec "${driver[@]}" "$@"; fi
"${driver[@]}" --twice
"${driver[@]}" --how faults --most 600
