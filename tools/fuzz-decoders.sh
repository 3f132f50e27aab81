#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the libraries that decode images from Debian's own sources into build/decoders/install, where the preset
# `fuzz-decoders` looks: with AddressSanitizer, the checks of UndefinedBehaviorSanitizer that stand for wrong memory or
# a crash, and coverage. With the installed ones a fuzzer neither sees what they do inside their blocks nor where it
# has been. Of the rest (shifts, overflows of signed numbers, which these libraries have in sums over damaged texels)
# nothing is asked. Six minutes of CPU, once.
# Where a mirror lacks the newest version, the release's own is taken; which ones were is in build/decoders/versions.
# The images that these sources bring, whole and broken ones, go into build/decoders/images.
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$PWD/build/decoders prefix=$PWD/build/decoders/install sources=$PWD/build/decoders/sources
tools/install-clang.sh
command -v dpkg-source >/dev/null || { echo "fuzz-decoders.sh: install dpkg-dev first" >&2; exit 2; }
mkdir -p "$folder" "$sources"

# The machine's own package lists seldom name sources, so this brings its own.
get_sources() {
  mkdir -p "$folder/apt/lists/partial"
  local release name key=/usr/share/keyrings/debian-archive-keyring.gpg
  release=$(. /etc/os-release && echo "$VERSION_CODENAME")
  printf 'deb-src [signed-by=%s] http://deb.debian.org/%s main\n' "$key" "debian $release" \
    "$key" "debian-security $release-security" >"$folder/apt/sources.list"
  lists=(-o "Dir::Etc::SourceList=$folder/apt/sources.list" -o Dir::Etc::SourceParts=/dev/null
    -o "Dir::State::Lists=$folder/apt/lists" -o "Dir::Cache=$folder/apt" -o APT::Sandbox::User=root)
  apt-get -qq "${lists[@]}" update
  for name in "$@"; do
    (cd "$sources" && { apt-get -qq "${lists[@]}" source --only-source "$name" ||
      apt-get -qq "${lists[@]}" source --only-source "$name/$release"; }) >"$folder/$name-source.log" 2>&1 ||
      { cat "$folder/$name-source.log" >&2 && exit 1; }
  done
}

checks=address,fuzzer-no-link,array-bounds,integer-divide-by-zero,null,return,unreachable,vla-bound
flags="-O1 -g1 -fno-omit-frame-pointer -fsanitize=$checks -fno-sanitize-recover=all"

# build NAME SOURCE [-DOPTION...]: by its own CMake, static.
build() {
  local name=$1 source=$2
  shift 2
  [[ ! -e $folder/$name.done ]] || return 0
  echo "$name: ${source##*/}"
  {
    cmake -S "$source" -B "$folder/build/$name" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_C_COMPILER=clang \
      -DCMAKE_CXX_COMPILER=clang++ "-DCMAKE_C_FLAGS=$flags" "-DCMAKE_CXX_FLAGS=$flags" -DBUILD_SHARED_LIBS=OFF \
      -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DBUILD_TESTING=OFF -DCMAKE_INSTALL_LIBDIR=lib \
      "-DCMAKE_PREFIX_PATH=$prefix" "-DCMAKE_INSTALL_PREFIX=$prefix" "$@"
    cmake --build "$folder/build/$name"
    cmake --install "$folder/build/$name"
  } >"$folder/$name.log" 2>&1 || { tail -n 30 "$folder/$name.log" >&2 && exit 1; }
  touch "$folder/$name.done"
}

# source_of NAME: the folder that Debian's sources were unpacked into.
source_of() { compgen -G "$sources/$1-[0-9]*/" | head -n 1 | sed 's,/$,,'; }

packages=(zlib libdeflate libpng1.6 libjpeg-turbo tiff imath openexr libwebp)
missing=()
for package in "${packages[@]}"; do
  [[ -n $(source_of "$package") ]] || missing+=("$package")
done
[[ ${#missing[@]} -eq 0 ]] || get_sources "${missing[@]}"
(cd "$sources" && printf '%s\n' ./*.dsc | sed 's,^./,,; s,\.dsc$,,') >"$folder/versions"

# by_make NAME SOURCE COMMAND...: what has no CMake of its own that works.
by_make() {
  local name=$1 source=$2
  shift 2
  [[ ! -e $folder/$name.done ]] || return 0
  echo "$name: ${source##*/}"
  (cd "$source" && "$@") >"$folder/$name.log" 2>&1 || { tail -n 30 "$folder/$name.log" >&2 && exit 1; }
  touch "$folder/$name.done"
}
make_zlib() {
  CC=clang CFLAGS="$flags -fPIC" ./configure --static --prefix="$prefix"
  make libz.a
  make install
}
make_libdeflate() {
  make CC=clang CFLAGS="$flags -fPIC" libdeflate.a
  cp libdeflate.h "$prefix/include"
  cp libdeflate.a "$prefix/lib"
}

for package in "${packages[@]}"; do
  mkdir -p "$folder/images/$package"
  (cd "$(source_of "$package")" &&
    find . -type f -regextype posix-extended -iregex '.*\.(png|jpe?g|tiff?|exr|webp|p[bgp]m|bmp|tga|hdr)' \
      -exec cp --parents -lft "$folder/images/$package" {} +)
done

by_make zlib "$(source_of zlib)" make_zlib
by_make libdeflate "$(source_of libdeflate)" make_libdeflate
build png "$(source_of libpng1.6)" -DPNG_SHARED=OFF -DPNG_TESTS=OFF -DPNG_EXECUTABLES=OFF
# Without its assembly, which nothing looks into.
build jpeg "$(source_of libjpeg-turbo)" -DENABLE_SHARED=OFF -DWITH_{TURBOJPEG,SIMD}=OFF "-DCMAKE_INSTALL_LIBDIR=$prefix/lib"
build webp "$(source_of libwebp)" -DWEBP_BUILD_{ANIM_UTILS,CWEBP,DWEBP,GIF2WEBP,IMG2WEBP,VWEBP,WEBPINFO,WEBPMUX,EXTRAS}=OFF
# The codings that pounce reads in a TIFF, LZMA and Zstandard by the installed libraries.
build tiff "$(source_of tiff)" -Dtiff-{tools,tests,contrib,docs}=OFF -Djbig=OFF -Dlerc=OFF -Dwebp=OFF
build imath "$(source_of imath)" -DIMATH_LIB_SUFFIX=
build openexr "$(source_of openexr)" -DOPENEXR_LIB_SUFFIX= -DOPENEXR_BUILD_TOOLS=OFF -DOPENEXR_INSTALL_EXAMPLES=OFF
echo "the decoders are in $prefix: $(tr '\n' ' ' <"$folder/versions")"
