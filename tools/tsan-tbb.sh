#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds Debian's own oneTBB with ThreadSanitizer into build/tsan-tbb/install, where the preset `tsan` looks.
# Without it every correct flow graph gives false reports: the library that apt installs is not instrumented.
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$PWD/build/tsan-tbb
if [[ -e $folder/install/lib/cmake/TBB/TBBConfig.cmake ]]; then
  echo "already there: $folder/install"
  exit 0
fi
mkdir -p "$folder"
cd "$folder"
if ! compgen -G 'onetbb-*/CMakeLists.txt' >/dev/null; then
  # The machine's own package lists seldom name sources, so this brings its own.
  mkdir -p apt/lists/partial
  release=$(. /etc/os-release && echo "$VERSION_CODENAME")
  echo "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian $release main" \
    >apt/sources.list
  lists=(-o "Dir::Etc::SourceList=$PWD/apt/sources.list" -o Dir::Etc::SourceParts=/dev/null
    -o "Dir::State::Lists=$PWD/apt/lists")
  apt-get "${lists[@]}" update
  apt-get "${lists[@]}" source --only-source onetbb
fi
source=$(compgen -G 'onetbb-*/CMakeLists.txt' | head -n 1)
cmake -S "${source%/*}" -B build -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DTBB_SANITIZE=thread \
  -DTBB_TEST=OFF -DTBBMALLOC_BUILD=OFF -DTBB_STRICT=OFF -DCMAKE_INSTALL_LIBDIR=lib \
  -DCMAKE_INSTALL_PREFIX="$folder/install"
cmake --build build
cmake --install build
