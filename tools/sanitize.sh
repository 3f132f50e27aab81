#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Whole jobs under sanitizers; any report fails.
#
#   tools/sanitize.sh short   the two programs with AddressSanitizer and UndefinedBehaviorSanitizer, as the fuzzers
#                             are built, and small jobs of every feature (tests/sanitize/transfers.sh); in .ci/sanitize
#   tools/sanitize.sh full    the same with odd files, every test of the preset asan, and the flow tests of the
#                             preset tsan (tools/tsan-tbb.sh must have run)
set -euo pipefail
cd "$(dirname "$0")/.."
mode=${1:-short}
[[ $mode == short || $mode == full ]] || {
  echo "usage: tools/sanitize.sh short|full" >&2
  exit 2
}

# The preset of the fuzzers: what .ci/sanitize needs of both is built once.
folder=$PWD/build/fuzz
tools/install-packages.sh
tools/install-clang.sh
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz --target pounce_cli pounce_fixture_cli
POUNCE=$folder/pounce POUNCE_FIXTURE=$folder/pounce-fixture bash tests/sanitize/transfers.sh "$mode"

[[ $mode == full ]] || exit 0
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 ASAN_OPTIONS=detect_stack_use_after_return=1
cmake --preset asan -DPOUNCE_BUILD_TESTS=ON
cmake --build --preset asan
ctest --preset asan -j2
cmake --preset tsan -DPOUNCE_BUILD_TESTS=ON
cmake --build --preset tsan
export TSAN_OPTIONS=halt_on_error=1
# Of these two the installed OpenImageIO, whose locks ThreadSanitizer does not see, starts threads to read a TIFF.
reads_tiff='^flow_(images|footprint)$'
ctest --preset tsan -L flow -E "$reads_tiff"
TSAN_OPTIONS=$TSAN_OPTIONS:ignore_noninstrumented_modules=1 ctest --preset tsan -R "$reads_tiff"
