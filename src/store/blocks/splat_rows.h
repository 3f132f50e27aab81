// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/page_pool.h"
#include "store/blocks/splat_block.h"

namespace pounce::store {

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
