// SPDX-License-Identifier: Apache-2.0
//
// A block of Gaussians as views draw it: columns as the store has them, and a tree of spheres.
//
// A view shows a Gaussian in a few tiles, while a ray's texels meet it hundreds of times. So
// nothing is unfolded here: what an ellipse needs is computed sixteen at a time when it is drawn.
// Less than half as large as a SplatSet, so that more of them stay decoded.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/page_pool.h"
#include "gaussian/splat_spheres.h"
#include "store/blocks/splat_block.h"

namespace pounce::gaussian {

struct SplatColumns {
  // As in SplatBlock, in whole registers; means are the centres of the tree's level 0.
  std::array<PageVector<float>, 3> sigma;
  std::array<PageVector<float>, 4> rotation;
  PageVector<float> alpha;
  std::array<PageVector<float>, 3> colour;
  std::uint32_t lobes = 0;
  PageVector<std::uint16_t> sh;  ///< 3 * lobes columns of size() one after the other
  SplatTree levels;

  std::size_t size() const { return levels[0].count; }

  /// Bytes of a block of so many Gaussians, known from the index before it is read.
  static std::uint64_t most_bytes(std::uint64_t splats, std::uint32_t lobes);
};

SplatColumns make_splat_columns(store::SplatBlock block);

}  // namespace pounce::gaussian
