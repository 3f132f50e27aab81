#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The checker must find a file that is one line too long, wherever in src/ it is, and let pass one that is not.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/src/io/image"

seq 500 >"$folder/src/io/image/full.cpp"
"$here/check_lengths.sh" "$folder" || { echo "500 lines were refused"; exit 1; }
for name in read.cpp read.h kernels.inl; do
  seq 501 >"$folder/src/io/image/$name"
  if said=$("$here/check_lengths.sh" "$folder"); then
    echo "not noticed: $name"
    exit 1
  fi
  [[ $said == "src/io/image/$name: more than 500 lines"* ]] || { echo "unclear: $said"; exit 1; }
  rm "$folder/src/io/image/$name"
done
