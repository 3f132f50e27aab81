// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/directions.h"
#include "store/blocks/geometry_block.h"

namespace pounce::surface {

/// The tangent frames of a block's texels, as a renderer has them: normal and tangent between the
/// corners of the triangle that owns a texel. Of a block with triangles, not of records; the block
/// must outlive it.
class TexelFrames {
 public:
  TexelFrames(const store::GeometryBlock& block, const mesh::Lattice& lattice);
  /// `texel` must be covered. The frame is usable.
  TangentFrame frame(std::uint32_t texel) const;
  /// Bytes for a block of so many triangles.
  static std::uint64_t bytes(std::uint64_t triangles) { return triangles * sizeof(Barycentrics); }

 private:
  /// Barycentrics of a triangle's corners 1 and 2 as affine functions of the texel in the block.
  struct Barycentrics {
    double x = 0, y = 0;  ///< corner 0
    double x1 = 0, y1 = 0, x2 = 0, y2 = 0;
  };

  const store::GeometryBlock& block_;
  std::vector<Barycentrics> triangles_;
};

}  // namespace pounce::surface
