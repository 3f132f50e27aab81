// SPDX-License-Identifier: Apache-2.0
//
// Where a target's surface is first met in a view: what says whether the view sees a texel.
#pragma once

#include <cstdint>
#include <vector>

#include "core/page_pool.h"
#include "mesh/mesh.h"
#include "views/grid.h"
#include "views/kernels.h"

namespace pounce::views {

/// Some rows of tiles of a view, with an apron around: rows of Grid::edge() + 2 kApron samples.
struct TargetDepths {
  std::uint32_t first_tile_y = 0, tile_rows = 0;
  std::uint32_t row = 0;
  PageVector<std::uint16_t> samples;  ///< of all triangles, whichever way they face
  PageVector<std::uint16_t> facing;   ///< of those that face the eye, by their vertices' normals

  static constexpr std::size_t kBehind = 16;  ///< samples behind the last row, for kernels

  std::uint32_t rows() const { return tile_rows * kTileEdge + 2 * kApron; }
  static std::uint64_t bytes(const Grid& grid, std::uint32_t tile_rows) {
    const std::uint64_t row = grid.edge() + 2 * kApron;
    return 2 * round_to_pages((row * (tile_rows * kTileEdge + 2 * kApron) + kBehind) *
                              sizeof(std::uint16_t));
  }
  /// Is anything of the target in this tile, or beside it?
  bool has(std::uint32_t tile_x, std::uint32_t tile_y) const;
  /// A tile's samples, as in Grid::image(kTargetSamples).
  std::vector<std::byte> tile(std::uint32_t tile_x, std::uint32_t tile_y) const;
  /// The same of what one sees with the near walls taken away, as in a doll's house: the depth of
  /// the first triangle that faces the eye, where the back of another is more than `gap` steps
  /// before it. Empty where that is next to nothing of the tile.
  std::vector<std::byte> inside(std::uint32_t tile_x, std::uint32_t tile_y, float gap) const;

 private:
  std::size_t at(std::uint32_t tile_x, std::uint32_t tile_y, std::size_t y) const {
    return (std::size_t{tile_y - first_tile_y} * kTileEdge + y) * row +
           std::size_t{tile_x} * kTileEdge;
  }
};

/// A triangle in a view: in pixels from the first sample's, and in steps of depth.
struct DepthTriangle {
  struct Corner {
    double x, y, depth;
  };
  Corner corners[3];
  bool faces;  ///< the eye
};

/// `mesh` has a normal for each vertex, as every mesh that was read.
TargetDepths draw_target(const mesh::Mesh& mesh, const Grid& grid, const ViewKernels& kernels,
                         std::uint32_t view, std::uint32_t first_tile_y, std::uint32_t tile_rows);

}  // namespace pounce::views
