// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "io/codec/guard.h"

namespace pounce::io {

// How far back the decoder of a strip or tile looks, for which it makes room by what is said there,
// and not by what the strip decodes to. Throws Error(input) where there is more than one such
// statement or where it is more than kMostWindowBytes. Where the bytes end before what they
// announce it is for the decoder to say so.

/// As much as zstd reads unless it is told otherwise; its highest level has as much, that of xz
/// half.
inline constexpr std::uint64_t kMostWindowBytes = 128 << 20;

/// Of a Zstandard frame.
std::uint64_t zstd_window(ByteSource& bytes, std::uint64_t begin, std::uint64_t size);
/// Of an xz stream of one block, which ends with LZMA2.
std::uint64_t xz_window(ByteSource& bytes, std::uint64_t begin, std::uint64_t size);

}  // namespace pounce::io
