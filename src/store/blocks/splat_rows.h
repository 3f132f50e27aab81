// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/page_pool.h"
#include "store/blocks/splat_block.h"

namespace pounce::store {

/// Coefficients of spherical harmonics beyond degree 0, of each colour channel, by highest degree.
inline constexpr std::array<std::uint32_t, 4> kLobesOfDegree{0, 3, 8, 15};
inline constexpr std::uint32_t kMostLobes = 15;

/// Gaussians on their way from a reader to the sort, in the source's order. Everything is in the
/// job's axes, the harmonics too.
struct SplatRows {
  std::uint32_t lobes = 0;  ///< per Gaussian and channel, one of kLobesOfDegree
  PageVector<Splat> splats;
  /// Half floats, 3 * lobes per Gaussian: coefficient by coefficient in the order of 3DGS, red,
  /// green and blue of each together. colour = Splat::colour + sum of basis(direction) * these.
  PageVector<std::uint16_t> sh;
};

}  // namespace pounce::store
