// SPDX-License-Identifier: Apache-2.0
//
// What a packed block of an EXR decodes to, without its texels.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/codec/guard.h"

namespace pounce::io {

/// A channel as the header of an EXR lists it.
struct ExrChannel {
  std::string name;
  std::uint32_t type = 0;  ///< 0: whole numbers, 1: half, 2: float
  std::uint64_t bytes() const { return type == 1 ? 2 : 4; }
};

/// How many bytes a deflated stream of `size` bytes holds, until it is more than `most`, or up to
/// what is damaged.
std::uint64_t inflated_bytes(Cursor& cursor, std::uint64_t begin, std::uint64_t size,
                             std::uint64_t most);

/// Why a block of DWA does not hold all texels of its channels; empty if it does. OpenEXR 3.1
/// believes the block's own counts, and hands out its buffers whatever came into them. `size` bytes
/// from `begin` on are a block of `width` times `rows` texels. Layout: ImfDwaCompressor.cpp of
/// OpenEXR. Not looked at: whether the coefficients of the cosine transform end too early.
std::string why_dwa_is_short(Cursor& at, std::uint64_t begin, std::uint64_t size,
                             std::span<const ExrChannel> channels, std::uint64_t width,
                             std::uint64_t rows);

}  // namespace pounce::io
