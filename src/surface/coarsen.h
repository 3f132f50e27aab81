// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"
#include "mesh/block_bins.h"

namespace pounce::surface {

/// A point of the surface, at a texel centre.
struct SurfacePoint {
  Vec3f position;
  Vec3f normal;   ///< between its triangle's; no longer than 1
  Vec2f uv;       ///< as in the mesh
  Vec4f tangent;  ///< kept, as the mesh's own are, for normal maps; zero if the mesh has none
};

/// Half a window of texels, in place of all the triangles in it.
struct CoarseTriangle {
  std::array<std::uint16_t, 3> points{};  ///< into CoarseSurface::points; wound as the mesh is
  std::uint32_t id = 0;                   ///< of a triangle that it stands for, and no other does
};

/// The surface of one block in fewer triangles than the mesh has there.
struct CoarseSurface {
  std::vector<SurfacePoint> points;
  std::vector<CoarseTriangle> triangles;
  std::vector<std::uint8_t> replaced;  ///< for each triangle of the block: is it not needed?
};

/// Is this a block that coarsen() is for: at least a triangle for every four texels?
bool is_dense(std::uint64_t triangles);

/// Where a block's triangles are smaller than texels, windows of 8x8 down to 1x1 texels take their
/// place as two triangles each. Where the surface bends, is torn, folded or doubled, it stays as it
/// is: what is replaced is off by at most 1/16 texel, in any direction. Nothing depends on more
/// than these triangles. `entries` are those of a source's block; `lattice` is its page's, with an
/// image.
CoarseSurface coarsen(const mesh::Mesh& mesh, const mesh::Lattice& lattice,
                      std::span<const mesh::BinEntry> entries);

/// Bytes that it needs at its peak, its result included, for a block of so many triangles.
std::uint64_t coarsen_bytes(std::uint64_t triangles);

}  // namespace pounce::surface
