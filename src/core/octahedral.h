// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "core/vec.h"

namespace pounce {

/// A direction in two 16-bit numbers: the octahedron |x| + |y| + |z| = 1 seen from above, its lower
/// half unfolded around the upper. A direction comes back within 7e-5 radians.
using Octahedral = std::array<std::int16_t, 2>;
/// Stands for the zero vector.
inline constexpr Octahedral kNoDirection{-32768, -32768};

inline Octahedral to_octahedral(Vec3f n) {
  const float size = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
  if (!(size > 0) || !std::isfinite(size)) return kNoDirection;
  float u = n.x / size, v = n.y / size;
  if (n.z < 0) {
    const float folded = 1 - std::abs(v);
    v = std::copysign(1 - std::abs(u), v);
    u = std::copysign(folded, u);
  }
  const auto steps = [](float w) {
    return static_cast<std::int16_t>(std::floor(std::clamp(w, -1.0F, 1.0F) * 32767 + 0.5F));
  };
  return {steps(u), steps(v)};
}

/// A unit vector, or zero.
inline Vec3f from_octahedral(Octahedral o) {
  float u = static_cast<float>(o[0]) * (1.0F / 32767),
        v = static_cast<float>(o[1]) * (1.0F / 32767);
  const float z = 1 - std::abs(u) - std::abs(v);
  const float below = std::max(-z, 0.0F);  // how far to fold back
  u -= std::copysign(below, u);
  v -= std::copysign(below, v);
  const float scale = 1 / std::sqrt(u * u + v * v + z * z);
  return o == kNoDirection ? Vec3f{} : Vec3f{u * scale, v * scale, z * scale};
}

}  // namespace pounce
