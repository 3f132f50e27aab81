// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/vec.h"

namespace pounce::fixture {

/// Colour as stored (sRGB-coded), 0 to 1.
using Rgb = std::array<float, 3>;

/// What is painted on a head, as a function of the unit direction from its centre: a smooth part
/// (gradients and band-limited waves) and, over it, sharp shapes in flat inks (letters, checkers,
/// thin lines, rings, eyes and a mouth). Letters stand upright where +y is up and longitude 0 is
/// +z. Pure functions, thread-safe.

/// The smooth part: sums of cosines of at most 20 periods per radian.
Rgb smooth_colour(Vec3d direction);

/// The ink at a direction: 0 = none (the smooth part shows), else an index into ink_colour().
struct Ink {
  std::uint8_t ink;
  double margin;  ///< radians: no other ink is nearer than this (a lower bound)
};
inline constexpr int kInkCount = 6;
Ink ink_at(Vec3d direction);
const Rgb& ink_colour(std::uint8_t ink);

/// The colour exactly at a direction.
Rgb pattern_colour(Vec3d direction);

/// The mean colour over a texel: the smooth part at its centre, the inks by 4 x 4 samples where the
/// texel may touch an edge. `direction_at(dx, dy)` gives the direction at an offset from the
/// texel's centre in texels; `reach` is no less than the angle (radians) from the centre to the
/// corners.
template <class DirectionAt>
Rgb area_colour(double reach, const DirectionAt& direction_at) {
  const Vec3d centre = direction_at(0.0, 0.0);
  const Ink ink = ink_at(centre);
  if (ink.margin > reach) return ink.ink == 0 ? smooth_colour(centre) : ink_colour(ink.ink);
  std::array<int, kInkCount> counts{};
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      ++counts[ink_at(direction_at((x - 1.5) / 4, (y - 1.5) / 4)).ink];
    }
  }
  Rgb mean{};
  for (std::uint8_t i = 0; i < kInkCount; ++i) {
    if (counts[i] == 0) continue;
    const Rgb colour = i == 0 ? smooth_colour(centre) : ink_colour(i);
    for (std::size_t c = 0; c < 3; ++c) {
      mean[c] += colour[c] * static_cast<float>(counts[i]) / 16.0F;
    }
  }
  return mean;
}

/// cos(2 pi turns) by a polynomial (error < 1e-6), so that pictures do not depend on the libm at
/// hand. |turns| < 2^40.
double cosine_turns(double turns);

}  // namespace pounce::fixture
