#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every command under every limit of memory (in steps of 8 MiB), threads, stacks and open files: see
# tests/cli/limits.sh. As root also the limits of threads. A quarter of an hour.
set -euo pipefail
cd "$(dirname "$0")/.."
POUNCE=$PWD/build/release/pounce POUNCE_FIXTURE=$PWD/build/release/pounce-fixture \
  POUNCE_LIMIT_STEP=${1:-8} bash tests/cli/limits.sh
