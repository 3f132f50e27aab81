// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "core/file.h"

namespace pounce::io {

/// A little-endian value anywhere in a buffer.
template <class T>
T value_at(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

template <class T>
T read_value(const ReadFile& file, std::uint64_t offset) {
  std::array<std::byte, sizeof(T)> raw;
  file.read(offset, raw);
  return value_at<T>(raw.data());
}

inline float byte_at(const std::byte* from) {
  return static_cast<float>(std::to_integer<unsigned>(*from));
}

/// The component of a unit quaternion that was left out because it is the largest, from the others.
inline float largest_of_four(float a, float b, float c) {
  return std::sqrt(std::max(0.0F, 1 - a * a - b * b - c * c));
}

}  // namespace pounce::io
