// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "pounce/options.h"

namespace pounce::io {

/// Bytes of one sample.
constexpr std::size_t sample_bytes(Depth depth) noexcept {
  return depth == Depth::u8 ? 1 : depth == Depth::float32 ? 4 : 2;
}

/// Turns `count` samples into doubles: integers scaled to 0..1, floats as they are.
void samples_to_double(Depth depth, std::size_t count, const std::byte* samples, double* out);

}  // namespace pounce::io
