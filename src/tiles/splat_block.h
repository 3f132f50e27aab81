// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "core/page_pool.h"

namespace pounce::tiles {

inline constexpr std::size_t kMostSplatsPerBlock = 4096;

/// Neighbouring Gaussians of a splat scene: structure of arrays, every column of the same length
/// (at most kMostSplatsPerBlock), in the store's order. Values are finite and filtered: what cannot
/// be seen or is broken never gets here.
struct SplatBlock {
  std::array<PageVector<float>, 3> mean;  ///< x, y, z, after --source-axes
  std::array<PageVector<float>, 3>
      sigma;  ///< standard deviations along the axes of `rotation`; >= 0
  /// Unit quaternion w, x, y, z. Axis k of the Gaussian is column k of its matrix.
  std::array<PageVector<float>, 4> rotation;
  PageVector<float> alpha;                  ///< opacity, in (0, 1]
  std::array<PageVector<float>, 3> colour;  ///< as the scene encodes it (sRGB-coded), not clamped
  /// Unit normals from the file; all empty where it has none (then the shortest axis is meant, and
  /// its sign is unknown).
  std::array<PageVector<float>, 3> normal;

  std::size_t size() const { return alpha.size(); }
};

}  // namespace pounce::tiles
