// SPDX-License-Identifier: Apache-2.0
//
// The numbers of footprint.cpp, for one texel and for sixteen at once.
#pragma once

namespace pounce::projection {

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
