// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/vec.h"

namespace pounce::projection {

/// What one target texel covers of a source image: a parallelogram around the hit. Its sides are
/// the target's texel axes, in texels of the source.
struct Footprint {
  Vec2d a, b;
};

/// How texel coordinates of the source change with position on its surface. Both lie in the plane
/// of the facet that was hit.
struct TexelGradients {
  Vec3f x, y;
};

/// The footprint of a target texel with these axes on the surface.
Footprint footprint_of(const TexelGradients& gradients, Vec3f along_x, Vec3f along_y) noexcept;
/// Of a target texel that is known by the length of its edge alone: a square somehow turned.
Footprint footprint_of(const TexelGradients& gradients, float edge) noexcept;

/// A grid of lookups in one level of an image, around the hit, that averages over a footprint. Each
/// level halves the sides of the one before; texels of level n are 2^n of the image's own.
struct Lookups {
  std::uint32_t level = 0;
  int count_a = 1, count_b = 1;  ///< along either side
  Vec2d step_a, step_b;          ///< from one to the next, in the image's own texels
  double share = 1;              ///< of the result
};

/// What a target texel that is smaller than a texel of the source takes back of the source's own
/// averaging, along the rows of its image and down its columns: shares of a texel's second
/// difference in steps of 2^-20, 0 to 1/24.
struct Sharpening {
  std::int32_t across = 0, down = 0;
  bool any() const { return (across | down) != 0; }
};

/// The lookups for a footprint: one set, or two where it goes over to the next level. An image has
/// levels 0 to `last_level`.
struct FootprintLookups {
  std::array<Lookups, 2> sets;
  int count = 1;
  Sharpening sharpening;  ///< of lookups in the image itself
  bool single() const { return count == 1 && sets[0].count_a == 1 && sets[0].count_b == 1; }
};

/// None where the footprint is a texel wide, rounding or not, or wider.
Sharpening sharpening_of(const Footprint& footprint) noexcept;

/// A footprint of at most one texel each way is one lookup in the image itself. noexcept,
/// thread-safe, the same bits everywhere.
FootprintLookups lookups_of(const Footprint& footprint, std::uint32_t last_level) noexcept;

// --- rules ---------------------------------------------------------------------------------------
//
// The numbers of footprint.cpp, for one texel and for sixteen at once.

inline constexpr double kExact = 65.0 / 64;  // sides up to here are one texel: rounding is below it
inline constexpr double kFine = 63.0 / 64;   // and from here on
inline constexpr double kSharpest = 43690;   // 1/24, in steps of 2^-20
inline constexpr double kNarrow = 1.5;       // texels of a level across a footprint
inline constexpr double kLong = 16;          // and along it
inline constexpr double kSpacing = 1.5;      // between lookups, in texels of their level
inline constexpr double kBlendFrom = 1.9;    // of 1 to 2: then the next level comes in
inline constexpr int kMostLookups = 16;      // along a side
inline constexpr double kMostTexels2 = 1e12;  // of a side, squared: beyond, nothing is known

}  // namespace pounce::projection
