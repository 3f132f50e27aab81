// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/bounds.h"
#include "core/page_pool.h"
#include "mesh/lattice.h"
#include "mesh/uv_raster.h"
#include "mesh/uv_tiles.h"

namespace pounce::mesh {

/// A triangle that is on no page.
inline constexpr std::uint32_t kNoPage = 0xFFFFFFFF;

/// Which triangles each page of a mesh has, in file order; one may be on several. Four bytes for
/// each time a triangle is on a page. Immutable.
class PageTriangles {
 public:
  PageTriangles() = default;
  /// From the page of each triangle, or kNoPage.
  PageTriangles(std::span<const std::uint32_t> triangle_page, std::size_t pages)
      : PageTriangles(pages, [&](auto&& put) {
          for (std::uint32_t t = 0; t < triangle_page.size(); ++t) {
            if (triangle_page[t] != kNoPage) put(triangle_page[t], t);
          }
        }) {}
  /// each(put) calls put(page, triangle), triangles rising, twice over: to count and to fill.
  template <class Each>
  PageTriangles(std::size_t pages, const Each& each) : first_(pages + 1, 0) {
    each([&](std::uint32_t page, std::uint32_t) { ++first_[page + 1]; });
    for (std::size_t p = 0; p < pages; ++p) first_[p + 1] += first_[p];
    triangles_.resize(first_.back());
    std::vector<std::uint64_t> next(first_.begin(), first_.end() - 1);
    each([&](std::uint32_t page, std::uint32_t triangle) { triangles_[next[page]++] = triangle; });
  }

  std::span<const std::uint32_t> of(std::size_t page) const {
    return {triangles_.data() + first_[page], triangles_.data() + first_[page + 1]};
  }
  std::size_t pages() const { return first_.empty() ? 0 : first_.size() - 1; }
  std::uint64_t size_bytes() const {
    return triangles_.size() * sizeof(std::uint32_t) + first_.size() * sizeof(std::uint64_t);
  }

 private:
  std::vector<std::uint64_t> first_;  ///< of each page, into triangles_; one more at the end
  PageVector<std::uint32_t> triangles_;
};

/// A triangle of the mesh as one page sees it; on a target whose UVs leave the image it may stand
/// in several periods of UV space.
struct TriangleInstance {
  std::uint32_t triangle = 0;  ///< index into Mesh::triangles
  std::int32_t shift_x = 0;    ///< periods subtracted from its texel coordinates
  std::int32_t shift_y = 0;
};

/// That an instance touches a 64x64 window of a page; the window starts at texel (64 x, 64 y).
struct BinEntry {
  std::uint32_t page = 0;
  std::int32_t y = 0, x = 0;
  TriangleInstance instance;
};

/// One window of one page and the instances that touch it, in file order.
struct BlockBin {
  std::uint32_t page = 0;
  std::int32_t x = 0, y = 0;
  std::uint32_t first = 0;  ///< into BlockBins::entries
  std::uint32_t count = 0;
};

/// What a triangle in a window is taken to need when stored: tiles are cut by it.
inline constexpr std::uint64_t kTileBytesPerTriangle = 80;
/// Stored bytes of a tile, at most, but for tests.
inline constexpr std::uint64_t kTileCapBytes = 1ULL << 20;
/// No tile holds more windows.
inline constexpr std::uint32_t kMostBlocksPerTile = 64;
/// A spatial tile: neighbouring blocks, stored together.
struct TileRange {
  std::uint32_t first_block = 0, block_count = 0;
};

/// The bins of one band.
struct BlockBins {
  PageVector<BinEntry> entries;  ///< by page, y, x and file order
  std::vector<BlockBin> blocks;  ///< in tile order
  std::vector<TileRange> tiles;
};

/// Which triangles each page has, and where a triangle belongs. All that it points to must outlive
/// its use.
struct BinRequest {
  const Mesh* mesh = nullptr;
  std::span<const Lattice> pages;
  const PageTriangles* triangles = nullptr;
  std::uint32_t first_page = 0;  ///< of `triangles`: what pages[0] stands for
  /// true (target): UVs that leave the image come back into it, or only those of `tile` count; a
  /// triangle goes to every block it touches.
  /// false (source): texel coordinates go on beyond the image; a whole triangle goes to the one
  /// block that holds its middle (but see shares_tiny), any other to every block it touches.
  bool is_target = false;
  std::optional<UvTile> tile;  ///< target: the only tile of UV space that is on its page
  std::uint64_t tile_cap_bytes = 0;
  /// source: tiny triangles, too, go to every block that they touch, so that each block has what it
  /// needs to say its surface in fewer.
  bool shares_tiny = false;
};
/// Source triangles at most this large in both directions, in texels, are kept whole in one block.
inline constexpr double kWholeTriangleTexels = 32;

/// Smaller source triangles, in both directions, are tiny: where they are many, a texel is about as
/// large as a triangle.
inline constexpr double kTinyTriangleTexels = 4;

std::array<Vec2d, 3> texel_corners(const Mesh& mesh, const Lattice& lattice,
                                   const TriangleInstance& instance);
/// Are these texel coordinates those of a sound file (kLargestTexel)? Not if one is NaN.
bool is_near(const Box2<double>& texels);
/// Is the source triangle kept whole (small, thin or large), or cut at block borders? Cutting makes
/// boxes small where an image has many triangles. One that covers a 256th of its image is large: an
/// image that is used once has few of these, and one that is repeated (tiling, trim sheets, a stray
/// coordinate) would be cut into more parts than its surface has texels.
bool is_whole(const std::array<Vec2d, 3>& corners, const Lattice& lattice);
bool is_tiny(const std::array<Vec2d, 3>& corners);
/// The block that holds the middle of a triangle: where it is counted.
struct HomeBlock {
  std::int32_t x = 0, y = 0;
};
HomeBlock home_block(const std::array<Vec2d, 3>& corners);

/// A mesh's blocks in bands: as many rows of blocks, one page after the other, as have kBandEntries
/// entries, or half as many as the mesh has triangles, which takes less memory than the mesh; at
/// least one row. Each band goes through the triangles of its pages, so there should not be many.
/// Bands depend on the request alone, not on the memory there is.
struct BlockBands {
  struct Row {
    std::uint32_t page;
    std::int32_t y;
  };
  struct Band {
    Row first, last;
    std::uint64_t entries = 0;
  };
  /// Which rows kTrianglesPerStretch triangles reach that follow each other on a page, or those
  /// that are left of it; of none first > last. Most files have neighbours together, so that a band
  /// can pass over most of its pages.
  struct Stretch {
    std::int32_t first = INT32_MAX, last = INT32_MIN;
  };
  std::vector<Band> bands;
  std::vector<Stretch> stretches;  ///< page after page
  std::uint64_t entries = 0;       ///< of all bands
  /// Of any window, at most. Only known of meshes of more than kFewTriangles, else it is entries.
  std::uint64_t most_in_block = 0;
};
inline constexpr std::uint64_t kFewTriangles = 1 << 16;
inline constexpr std::uint64_t kBandEntries = 1 << 18;
inline constexpr std::size_t kTrianglesPerStretch = 1024;
/// Visits rows of blocks, not blocks. Throws Error(input) when the UVs span an absurd number of
/// texels or blocks.
BlockBands count_bands(const BinRequest& request);
BlockBands count_bands(const BinRequest& request, std::uint64_t band_entries);

/// Bins triangles into blocks and groups the blocks into tiles by a k-d split in integers, band by
/// band, so that it needs memory for one band alone. Const members are thread-safe.
class BlockBinner {
 public:
  /// `bands`: what count_bands() says of this request.
  BlockBinner(const BinRequest& request, std::shared_ptr<const BlockBands> bands);
  /// Counts them itself.
  explicit BlockBinner(const BinRequest& request);

  std::uint64_t entries() const { return bands_->entries; }  ///< of all bands
  std::size_t bands() const { return bands_->bands.size(); }
  std::uint64_t entries(std::size_t band) const { return bands_->bands[band].entries; }
  std::uint64_t most_entries() const;  ///< of a band
  std::uint64_t most_in_block() const { return bands_->most_in_block; }
  BlockBins bin(std::size_t band) const;
  /// Bytes that bin() needs at its peak, its result included, for so many entries.
  static std::uint64_t cost_bytes(std::uint64_t entries);

 private:
  BinRequest request_;
  std::shared_ptr<const BlockBands> bands_;
};

}  // namespace pounce::mesh
