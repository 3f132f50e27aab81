// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "mesh/lattice.h"
#include "mesh/uv_raster.h"
#include "mesh/uv_tiles.h"

namespace pounce::mesh {

inline constexpr std::uint32_t kNoPage = 0xFFFFFFFF;

/// A triangle of the mesh as one page sees it; on a target whose UVs leave the image it may stand
/// in several periods of UV space.
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

/// No tile holds more windows.
inline constexpr std::uint32_t kMostBlocksPerTile = 64;
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

/// Which page shows a tile of a target's UV space, for targets of many UDIMs. Tiles that are not in
/// it are not written.
class TilePages {
 public:
  void add(UvTile tile, std::uint32_t set, std::uint32_t page) { pages_[{set, tile}] = page; }
  /// The page of a tile of a texture set, or kNoPage.
  std::uint32_t find(std::uint32_t set, UvTile tile) const {
    const auto at = pages_.find({set, tile});
    return at == pages_.end() ? kNoPage : at->second;
  }
  /// ((texture set, tile), page), sorted.
  const std::map<std::pair<std::uint32_t, UvTile>, std::uint32_t>& all() const { return pages_; }

 private:
  std::map<std::pair<std::uint32_t, UvTile>, std::uint32_t> pages_;
};

/// Which triangles each page has, and where a triangle belongs.
struct BinRequest {
  const Mesh* mesh = nullptr;
  std::span<const Lattice> pages;
  /// Per triangle: its page, or with tile_pages its texture set; kNoPage = not in any.
  std::span<const std::uint32_t> triangle_page;
  /// true (target): UVs that leave the image come back into it, or go to the page of their tile; a
  /// triangle goes to every block it touches.
  /// false (source): texel coordinates go on beyond the image; a triangle that is small or thin
  /// goes to the one block that holds its middle, a large one to every block it touches.
  bool is_target = false;
  /// Target: the page of every tile; null: UVs wrap around into the triangle's page. All pages are
  /// of one size then.
  const TilePages* tile_pages = nullptr;
  std::uint64_t tile_cap_bytes = 0;
};
/// Source triangles at most this large in both directions, in texels, are kept whole in one block.
inline constexpr double kWholeTriangleTexels = 32;

std::array<Vec2d, 3> texel_corners(const Mesh& mesh, const Lattice& lattice,
                                   const TriangleInstance& instance);
/// Is the source triangle kept whole (small, thin or large), or cut at block borders? Cutting makes
/// boxes small where an image has many triangles. One that covers a 256th of its image is large: an
/// image that is used once has few of these, and one that is repeated (tiling, trim sheets, a stray
/// coordinate) would be cut into more parts than its surface has texels.
bool is_whole(const std::array<Vec2d, 3>& corners, const Lattice& lattice);

/// Bins triangles into blocks and groups the blocks into tiles by a k-d split in integers. Throws
/// Error(input) when the UVs span an absurd number of blocks.
BlockBins bin_triangles(const BinRequest& request);

/// Bytes that bin_triangles needs at its peak for so many triangles and block entries.
std::uint64_t bin_cost_bytes(std::uint64_t triangles, std::uint64_t entries);
/// How many (block, triangle) entries bin_triangles will make.
std::uint64_t count_entries(const BinRequest& request);

}  // namespace pounce::mesh
