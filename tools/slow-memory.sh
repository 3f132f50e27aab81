#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Random small jobs (overlapping UVs, UDIMs, several channels and targets, painting over, splats, 1 to 8 threads) with the
# least memory that the plan names, a page less, and budgets around it: that least works, less is refused, and nothing is an
# internal error. Half a second each.
# Usage: tools/slow-memory.sh [JOBS] [FIRST_SEED]
set -euo pipefail
cd "$(dirname "$0")/.."
[[ -x build/release/slow_memory ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
exec build/release/slow_memory "${1:-300}" "${2:-1}"
