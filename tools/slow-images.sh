#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# 1300 small images of every kind that libpng, libjpeg, libtiff, OpenEXR and libwebp write, and those of the test data where
# it is: does the reader hand out what is in them? Held against the samples that were written, against OpenImageIO, and
# against tests/slow/image_corpus.tsv, which says what was read before. A minute. The images in the sources of these
# libraries too, where tools/fuzz-decoders.sh has brought them.
# Usage: tools/slow-images.sh [OPTION...]        (build/release/slow_images --help tells them)
#   tools/slow-images.sh --only tiff-rgb         some of them
#   tools/slow-images.sh --files FOLDER          more images
# After a change that is meant to change what is read: tools/slow-images.sh --record tests/slow/image_corpus.tsv
set -euo pipefail
cd "$(dirname "$0")/.."
program=build/release/slow_images work=build/release/slow-images
[[ -x $program ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
data=${POUNCE_TEST_DATA:-$PWD/../shared/data}
record=(--against tests/slow/image_corpus.tsv) sources=()
[[ ! -d build/decoders/images ]] || sources=(--files build/decoders/images)
for word in "$@"; do
  [[ $word != --record && $word != --against ]] || record=()
done
exec "$program" "$work" --files "$data" "${sources[@]}" "${record[@]}" "$@"
