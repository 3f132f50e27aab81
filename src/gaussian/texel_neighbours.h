// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/page_pool.h"
#include "gaussian/texel_gaussians.h"
#include "store/blocks/geometry_block.h"

namespace pounce::gaussian {

/// Which texels around a Gaussian of a mesh continue its surface: they lie beside it in its chart
/// and in space. Two charts may touch in the image, and a chart may lie on another one: place tells
/// them apart. Knows the triangles of the blocks that it was given; where there are none, a
/// triangle's texels continue as far as the triangle goes.
class TexelNeighbours {
 public:
  static constexpr int kReach = 2;  ///< texels in each direction

  TexelNeighbours();
  /// Begins anew, around this block.
  void start(std::int32_t block_x, std::int32_t block_y);
  /// Notes where the triangles of this or a neighbouring block are.
  void add(const store::GeometryBlock& block, const mesh::Lattice& lattice);
  /// Of a Gaussian of the block in the middle that is a whole texel: does (x + dx, y + dy) continue
  /// its surface? Both at most kReach in size.
  bool continues(const MeshGaussian& g, const TexelFrame& frame, int dx, int dy) const;

  static std::uint64_t bytes() {
    return round_to_pages(std::uint64_t{kEdge} * kEdge * sizeof(Spot));
  }

 private:
  /// Triangles that are no larger than this over the block's border are seen whole; others reach as
  /// far as they like.
  static constexpr int kMargin = 16 + kReach, kEdge = mesh::kBlockEdge + 2 * kMargin;
  static constexpr std::size_t kLayers = 4;  ///< of charts that lie upon each other
  struct Spot {
    std::uint32_t layers = 0;
    std::array<Vec3f, kLayers> places;
  };

  std::int64_t left_ = 0, top_ = 0;
  PageVector<Spot> spots_;  ///< kEdge rows of kEdge
};

}  // namespace pounce::gaussian
