#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian packages that building pounce needs and that are not there yet. Does nothing when all are.
set -eu

packages="g++ cmake ninja-build pkg-config libtbb-dev libzstd-dev libxxhash-dev libfmt-dev libspdlog-dev
libcli11-dev nlohmann-json3-dev libtinygltf-dev libopenimageio-dev libopencolorio-dev libimath-dev zlib1g-dev
openimageio-tools catch2 libbenchmark-dev libpng-dev libjpeg62-turbo-dev libtiff-dev libopenexr-dev libwebp-dev
libseccomp-dev libdraco-dev libmeshoptimizer-dev libeigen3-dev"

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  echo "install-packages.sh: this system has no apt-get. pounce is built and tested on Debian 12 (bookworm);" \
    "elsewhere install a C++20 compiler, CMake 3.25, Ninja, oneTBB, zstd, xxHash, fmt, spdlog, CLI11," \
    "nlohmann-json, tinygltf, OpenImageIO, OpenColorIO 2, Imath, zlib, Catch2 2.x, libpng, libjpeg-turbo, libtiff," \
    "OpenEXR, libwebp, libseccomp, Draco, meshoptimizer, Eigen and Google Benchmark, then run cmake." >&2
  exit 2
fi

missing=""
for package in $packages; do
  state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$state" = installed ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

as_root=""
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "install-packages.sh: needs root or sudo to install:$missing" >&2
    exit 2
  fi
  as_root=sudo
fi
echo "Installing:$missing"
$as_root apt-get update
# shellcheck disable=SC2086  # a list of words on purpose
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $missing || {
  echo "install-packages.sh: apt-get could not install these packages. Their names are those of Debian 12" \
    "(bookworm); other releases may lack some or name them differently." >&2
  exit 1
}
