// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mesh/lattice.h"
#include "mesh/uv_raster.h"

namespace pounce::mesh {

/// A triangle of the mesh as one page sees it; on a wrapping target it may stand in several image
/// periods.
struct TriangleInstance {
  std::uint32_t triangle = 0;  ///< index into Mesh::triangles
  std::int32_t shift_x = 0;    ///< periods subtracted from its texel coordinates
  std::int32_t shift_y = 0;
};

/// One 64x64 window of one page and the instances that touch it, in file order.
struct BlockBin {
  std::uint32_t page = 0;
  std::int32_t x = 0, y = 0;  ///< the window starts at texel (64 x, 64 y)
  std::uint32_t first = 0;    ///< into BlockBins::entries
  std::uint32_t count = 0;
};

/// A spatial tile: neighbouring blocks, stored together.
struct TileRange {
  std::uint32_t first_block = 0, block_count = 0;
};

struct BlockBins {
  std::vector<TriangleInstance> instances;
  std::vector<std::uint32_t> entries;  ///< indices into instances
  std::vector<BlockBin> blocks;        ///< in tile order
  std::vector<TileRange> tiles;
};

/// Which triangles each page has, and where a triangle belongs.
struct BinRequest {
  const Mesh* mesh = nullptr;
  std::span<const Lattice> pages;
  std::span<const std::uint32_t> triangle_page;  ///< per triangle; kNoPage = not in any
  /// true (target): UVs wrap into the image; a triangle goes to every block it touches.
  /// false (source): texel coordinates go on beyond the image; a triangle that is small or thin
  /// goes to the one block that holds its middle, a large one to every block it touches.
  bool wrap_into_image = false;
  std::uint64_t tile_cap_bytes = 0;
};
inline constexpr std::uint32_t kNoPage = 0xFFFFFFFF;

/// Source triangles at most this large in both directions, in texels, are kept whole in one block.
inline constexpr double kWholeTriangleTexels = 32;

std::array<Vec2d, 3> texel_corners(const Mesh& mesh, const Lattice& lattice,
                                   const TriangleInstance& instance);
/// Is the source triangle kept whole (small, thin or vast), or cut at block borders?
bool is_whole(const std::array<Vec2d, 3>& corners);

/// Bins triangles into blocks and groups the blocks into tiles by a k-d split in integers. Throws
/// Error(input) when the UVs span an absurd number of blocks.
BlockBins bin_triangles(const BinRequest& request);

/// Bytes that bin_triangles needs at its peak for so many triangles and block entries.
std::uint64_t bin_cost_bytes(std::uint64_t triangles, std::uint64_t entries);
/// How many (block, triangle) entries bin_triangles will make.
std::uint64_t count_entries(const BinRequest& request);

}  // namespace pounce::mesh
