// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "pounce/options.h"

namespace pounce::io {

/// Bytes of one sample.
constexpr std::size_t sample_bytes(Depth depth) noexcept {
  return depth == Depth::u8 ? 1 : depth == Depth::float32 ? 4 : 2;
}

/// Turns `count` samples into doubles: integers scaled to 0..1, floats as they are.
void samples_to_double(Depth depth, std::size_t count, const std::byte* samples, double* out);

/// Divides the colours of `texels` texels by their last channel (alpha), in place; where alpha is 0
/// the colours stay as they are. Integers round to nearest and are cut at the largest value.
void divide_by_alpha(Depth depth, std::uint32_t channels, std::size_t texels, std::byte* samples);

/// Multiplies the colours by alpha, in place. Integers round to nearest.
void multiply_by_alpha(Depth depth, std::uint32_t channels, std::size_t texels, std::byte* samples);

}  // namespace pounce::io
