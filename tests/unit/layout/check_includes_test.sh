#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The checker must find what it is there for: a copy of the tree with one broken rule each is refused.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

try_line() {  # file, line that breaks a rule, words of the complaint
  rm -rf "${folder:?}"/*
  mkdir -p "$folder"/{src/{core,mesh,io},include/pounce,tools}
  mkdir -p "$folder/$(dirname "$1")"
  echo '#include "core/vec.h"' >"$folder/src/mesh/good.h"
  "$here/check_includes.sh" "$folder" || { echo "a sound tree was refused"; exit 1; }
  echo "$2" >"$folder/$1"
  if said=$("$here/check_includes.sh" "$folder"); then
    echo "not noticed: $1: $2"
    exit 1
  fi
  [[ $said == *"$1:1: "*"$3"* ]] || { echo "unclear: $said"; exit 1; }
}

try_line src/core/bad.h '#include "mesh/mesh.h"' 'core/ must not include mesh/'
try_line src/store/pack/bad.h '#include "store/blocks/codec.h"' 'store/pack/ must not include store/blocks/'
try_line src/surface/bad.cpp '#include "projection/search.h"' 'surface/ must not include projection/'
try_line src/mesh/bad.cpp '#include <tiny_gltf.h>' 'only src/io/'
try_line tools/bad.cpp '#include <OpenImageIO/imageio.h>' 'only src/io/'
try_line include/pounce/bad.h '#include <tbb/flow_graph.h>' 'public header'
try_line include/pounce/bad.h '#include "core/vec.h"' 'public header'
