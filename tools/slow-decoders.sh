#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Images that were made to do harm, and decoders that may have faults. Four checks:
# 1. every class of image that tools/slow-images.sh writes and those in the sources of the libraries themselves, and
#    2000 that are made from them by damage (always the same ones), each read in two processes whose new memory holds
#    other bytes: the same samples or the same refusal, in time, within the memory that a job gives its decoder
# 2. what is in these sources, held against OpenImageIO
# 3. each tenth of the classes under valgrind's memcheck, where it is installed
# 4. fuzzing, with the decoding libraries built anew so that the sanitizers see into them: tools/fuzz-decoders.sh
# Usage: tools/slow-decoders.sh [SECONDS for two fuzz targets side by side]   (default 1800; 0: none), after tools/test.sh
# Mutants that fail are kept in build/release/slow-decoders, what the fuzzers find in build/fuzz-decoders/findings.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-1800}
programs=build/release classes=build/release/slow-images keep=build/release/slow-decoders
for program in slow_images slow_decoders; do
  [[ -x $programs/$program ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
done
tools/fuzz-decoders.sh
failed=()

# The classes are read as before, and so is what the libraries bring.
tools/slow-images.sh || failed+=("images")
"$programs/slow_decoders" "$classes" build/decoders/images --mutants 2000 --keep "$keep" || failed+=("memory")

# Without libjpeg-turbo's assembly, which memcheck does not follow: it then calls samples unwritten that are the same
# whatever is in memory.
if command -v valgrind >/dev/null; then
  JSIMD_FORCENONE=1 valgrind -q --error-exitcode=99 --leak-check=no "$programs/slow_decoders" "$classes" \
    --every 10 --mutants 100 || failed+=("valgrind")
else
  echo "SKIPPED: memcheck (valgrind is not installed)"
fi

if [[ $seconds -gt 0 ]]; then
  mkdir -p build/fuzz-decoders/corpus/decode
  find "$classes" build/decoders/images -type f -size -64k ! -name '*.tsv' \
    -exec cp --parents -t build/fuzz-decoders/corpus/decode {} +
  POUNCE_FUZZ_AT_ONCE=${POUNCE_FUZZ_AT_ONCE:-2} POUNCE_FUZZ_PRESET=fuzz-decoders \
    tools/slow-fuzz.sh "$seconds" decode image || failed+=("fuzzing")
fi
echo "defects in: ${failed[*]:-nothing}"
[[ ${#failed[@]} -eq 0 ]]
