#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Installs clang, its runtimes (sanitizers, libFuzzer) and a linker that is quick with them, if they are not there:
# what the preset fuzz needs.
set -eu
if command -v clang++ >/dev/null && command -v ld.lld >/dev/null &&
  ls /usr/lib/llvm-*/lib/clang/*/lib/linux/libclang_rt.fuzzer-x86_64.a >/dev/null 2>&1; then
  exit 0
fi
as_root=""
[ "$(id -u)" -eq 0 ] || as_root=sudo
$as_root apt-get update
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends clang lld libclang-rt-14-dev
