#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing, builds the preset `release` and runs every test.
# Usage: tools/test.sh [ctest arguments, e.g. -L cli -R memory]
# Everything the tests said is kept in build/release/Testing/test.log.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/install-packages.sh
echo "== Building (preset release)"
cmake --preset release -DPOUNCE_BUILD_TESTS=ON
cmake --build --preset release

# Models and tangents are compared with other people's programs where npm can bring them; else those tests are skipped.
timeout 120 tools/install-oracles.sh "$PWD/build/release/npm" || echo "the oracles of npm could not be installed"

echo "== Testing"
results=$PWD/build/release/Testing
mkdir -p "$results"
rm -f "$results/test.log" "$results/junit.xml"
status=0
ctest --test-dir build/release --output-on-failure -j2 --no-tests=error --output-log "$results/test.log" \
  --output-junit "$results/junit.xml" "$@" || status=$?

# Tests that ctest skipped, and checks that a passing script left out: its log also holds what passing tests printed.
said=build/release/Testing/Temporary/LastTest.log
left_out=$(grep -c '^SKIPPED:' "$said" || true)
without_data=$(grep -c '^SKIPPED: needs test data' "$said" || true)
echo "$left_out checks were SKIPPED, $without_data of them because test data is missing (POUNCE_TEST_DATA)"
grep '^SKIPPED:' "$said" | sort | uniq -c || true

# count NAME: an attribute of the whole run in JUnit's form.
count() { tr '\n' ' ' <"$results/junit.xml" | sed -E "s/.*<testsuite [^>]*$1=\"([0-9]+)\".*/\1/"; }
if [[ -s $results/junit.xml ]]; then
  failed=$(count failures) skipped=$(count skipped)
  echo "$(($(count tests) - failed - skipped)) passed, $failed failed, $skipped skipped"
else
  echo "0 passed, 0 failed, 0 skipped"
fi
exit $status
