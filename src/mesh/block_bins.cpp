// SPDX-License-Identifier: Apache-2.0
//
// Which triangles touch which 64x64 window of texels, and which windows make a tile.
//
// Blocks are made from these bins, in any order and in parallel, so neither side needs an external
// shuffle. Tiles come from a k-d split over block coordinates: integers only, so the same on every
// machine. A tile's weight is an estimate of its stored bytes; it bounds a write buffer and sizes
// the index pages.
#include "mesh/block_bins.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "pounce/error.h"

namespace pounce::mesh {
namespace {

constexpr std::uint64_t kMostEntries = 1ULL << 24;
constexpr double kLargeShare = 1.0 / 256;     // of an image
constexpr std::uint32_t kConstantRun = 1024;  // triangles of a page without an image, per block

struct KeyedEntry {
  std::uint32_t page;
  std::int32_t y, x;
  std::uint32_t instance;
  auto operator<=>(const KeyedEntry&) const = default;
};

std::int32_t block_of(double texel) {
  return static_cast<std::int32_t>(std::floor(texel / kBlockEdge));
}

[[noreturn]] void fail_span(const Mesh& mesh, std::uint32_t triangle) {
  throw Error(
      ErrorKind::input,
      fmt::format(
          "{}: the UVs span too many texels (triangle {}): rescale the UVs or use a smaller image",
          mesh.path, triangle));
}

/// Blocks, both ends included.
struct BlockRange {
  std::int32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// Calls visit(x, y) for every block of the range that the triangle touches. Halves the range, so
/// that a long thin triangle does not pay for all of its box.
template <class Visit>
void visit_blocks(const std::array<Vec2d, 3>& corners, const BlockRange& range,
                  const Visit& visit) {
  if (range.x0 > range.x1 || range.y0 > range.y1) return;
  const TexelWindow window{std::int64_t{range.x0} * kBlockEdge, std::int64_t{range.y0} * kBlockEdge,
                           (std::int64_t{range.x1} + 1) * kBlockEdge,
                           (std::int64_t{range.y1} + 1) * kBlockEdge};
  if (!triangle_touches(corners, window, 1.0)) return;
  const std::int32_t across = range.x1 - range.x0, down = range.y1 - range.y0;
  if (across == 0 && down == 0) {
    visit(range.x0, range.y0);
  } else if (across >= down) {
    const std::int32_t middle = range.x0 + across / 2;
    visit_blocks(corners, {range.x0, range.y0, middle, range.y1}, visit);
    visit_blocks(corners, {middle + 1, range.y0, range.x1, range.y1}, visit);
  } else {
    const std::int32_t middle = range.y0 + down / 2;
    visit_blocks(corners, {range.x0, range.y0, range.x1, middle}, visit);
    visit_blocks(corners, {range.x0, middle + 1, range.x1, range.y1}, visit);
  }
}

/// Calls visit(page, instance, block_x, block_y) for every block a triangle belongs to.
template <class Visit>
void for_each_block(const BinRequest& request, std::uint32_t triangle, Visit&& visit) {
  const std::uint32_t own = request.triangle_page[triangle];
  const Lattice& lattice = request.pages[request.tile_pages != nullptr ? 0 : own];
  if (lattice.width == 0) {
    // No image, so no texels: runs of the file's order stand in for blocks.
    visit(own, TriangleInstance{triangle, 0, 0}, static_cast<std::int32_t>(triangle / kConstantRun),
          0);
    return;
  }
  const auto corners = texel_corners(*request.mesh, lattice, {triangle, 0, 0});
  const auto [low_x, high_x] = std::minmax({corners[0].x, corners[1].x, corners[2].x});
  const auto [low_y, high_y] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
  if (!(std::abs(low_x) < kLargestTexel && std::abs(high_x) < kLargestTexel &&
        std::abs(low_y) < kLargestTexel && std::abs(high_y) < kLargestTexel)) {
    fail_span(*request.mesh, triangle);
  }
  if (!request.is_target && is_whole(corners, lattice)) {
    visit(own, TriangleInstance{triangle, 0, 0}, block_of((low_x + high_x) / 2),
          block_of((low_y + high_y) / 2));
    return;
  }
  // It touches at least as many blocks as it has room for: no need to visit them to know.
  constexpr double kMostArea = static_cast<double>(kMostEntries) * kBlockEdge * kBlockEdge;
  const double area = std::abs(doubled_area(corners[0], corners[1], corners[2])) / 2;
  if (area > kMostArea) fail_span(*request.mesh, triangle);
  const auto visit_touched = [&](std::uint32_t page, const TriangleInstance& instance, double bx0,
                                 double by0, double bx1, double by1) {
    const double sx = static_cast<double>(instance.shift_x) * lattice.width;
    const double sy = static_cast<double>(instance.shift_y) * lattice.height;
    const std::array<Vec2d, 3> moved{Vec2d{corners[0].x - sx, corners[0].y - sy},
                                     Vec2d{corners[1].x - sx, corners[1].y - sy},
                                     Vec2d{corners[2].x - sx, corners[2].y - sy}};
    const std::int64_t across = block_of(bx1) - block_of(bx0) + 1;
    const std::int64_t down = block_of(by1) - block_of(by0) + 1;
    if (across * down > static_cast<std::int64_t>(kMostEntries)) fail_span(*request.mesh, triangle);
    visit_blocks(moved, {block_of(bx0), block_of(by0), block_of(bx1), block_of(by1)},
                 [&](std::int32_t x, std::int32_t y) { visit(page, instance, x, y); });
  };
  if (!request.is_target) {
    visit_touched(own, {triangle, 0, 0}, low_x, low_y, high_x, high_y);
    return;
  }
  if (area == 0) return;
  const double w = lattice.width, h = lattice.height;
  // Periods in which some texel centre may be covered; a triangle wholly inside [0,1) has exactly
  // one.
  const auto first_x = static_cast<std::int32_t>(std::floor(std::ceil(low_x) / w));
  const auto last_x = static_cast<std::int32_t>(std::floor(std::floor(high_x) / w));
  const auto first_y = static_cast<std::int32_t>(std::floor(std::ceil(low_y) / h));
  const auto last_y = static_cast<std::int32_t>(std::floor(std::floor(high_y) / h));
  if ((std::int64_t{last_x} - first_x + 1) * (std::int64_t{last_y} - first_y + 1) > 65536) {
    fail_span(*request.mesh, triangle);
  }
  for (std::int32_t sy = first_y; sy <= last_y; ++sy) {
    for (std::int32_t sx = first_x; sx <= last_x; ++sx) {
      const std::uint32_t page = request.tile_pages == nullptr
                                     ? own
                                     : request.tile_pages->find(own, tile_of_period(sx, sy));
      if (page == kNoPage) continue;
      visit_touched(page, {triangle, sx, sy}, std::max(low_x - sx * w, 0.0),
                    std::max(low_y - sy * h, 0.0), std::min(high_x - sx * w, w - 1),
                    std::min(high_y - sy * h, h - 1));
    }
  }
}

/// Cuts blocks[first, first + count) until each part is light enough, reordering them.
void split_tiles(BlockBins& bins, std::uint32_t first, std::uint32_t count, std::uint64_t cap) {
  const auto weight = [](const BlockBin& b) {
    return 256 + std::uint64_t{80} * std::min<std::uint32_t>(b.count, 8192);
  };
  std::uint64_t total = 0;
  auto* begin = bins.blocks.data() + first;
  for (std::uint32_t i = 0; i < count; ++i) total += weight(begin[i]);
  if (count == 1 || (total <= cap && count <= kMostBlocksPerTile)) {
    bins.tiles.push_back({first, count});
    return;
  }
  std::int32_t x0 = begin->x, x1 = begin->x, y0 = begin->y, y1 = begin->y;
  for (std::uint32_t i = 0; i < count; ++i) {
    x0 = std::min(x0, begin[i].x), x1 = std::max(x1, begin[i].x);
    y0 = std::min(y0, begin[i].y), y1 = std::max(y1, begin[i].y);
  }
  const bool by_x = x1 - x0 > y1 - y0;
  std::stable_sort(begin, begin + count, [&](const BlockBin& a, const BlockBin& b) {
    return by_x ? std::tie(a.x, a.y) < std::tie(b.x, b.y) : std::tie(a.y, a.x) < std::tie(b.y, b.x);
  });
  std::uint64_t left = 0;
  std::uint32_t cut = 0;
  while (cut + 1 < count && (cut == 0 || left + weight(begin[cut]) <= total / 2))
    left += weight(begin[cut++]);
  split_tiles(bins, first, cut, cap);
  split_tiles(bins, first + cut, count - cut, cap);
}

}  // namespace

std::array<Vec2d, 3> texel_corners(const Mesh& mesh, const Lattice& lattice,
                                   const TriangleInstance& instance) {
  std::array<Vec2d, 3> corners;
  const auto& triangle = mesh.triangles[instance.triangle];
  for (std::size_t k = 0; k < 3; ++k) {
    corners[k] = to_texel(lattice, mesh.uv_sets[lattice.uv_set][triangle[k]]);
    corners[k].x -= static_cast<double>(instance.shift_x) * lattice.width;
    corners[k].y -= static_cast<double>(instance.shift_y) * lattice.height;
  }
  return corners;
}

bool is_whole(const std::array<Vec2d, 3>& c, const Lattice& lattice) {
  const auto [low_x, high_x] = std::minmax({c[0].x, c[1].x, c[2].x});
  const auto [low_y, high_y] = std::minmax({c[0].y, c[1].y, c[2].y});
  const double extent = std::max(high_x - low_x, high_y - low_y);
  if (extent <= kWholeTriangleTexels) return true;
  const double area = std::abs(doubled_area(c[0], c[1], c[2]));
  // Thin: its height over the longest side is below a texel, so cutting it gains nothing.
  return area < extent ||
         area >= 2 * kLargeShare * static_cast<double>(lattice.width) * lattice.height;
}

std::uint64_t count_entries(const BinRequest& request) {
  std::uint64_t entries = 0;
  for (std::uint32_t t = 0; t < request.mesh->triangles.size(); ++t) {
    if (request.triangle_page[t] == kNoPage) continue;
    // Inside the visit: one triangle over many periods of a large image has billions of blocks.
    for_each_block(request, t,
                   [&](std::uint32_t, const TriangleInstance&, std::int32_t, std::int32_t) {
                     if (++entries > kMostEntries) fail_span(*request.mesh, t);
                   });
  }
  return entries;
}

std::uint64_t bin_cost_bytes(std::uint64_t triangles, std::uint64_t entries) {
  // instances (twice while the vector grows) + keyed entries + entries + blocks (at most one per
  // entry)
  return triangles * 2 * sizeof(TriangleInstance) +
         entries * (sizeof(KeyedEntry) + 4 + sizeof(BlockBin) + 4);
}

BlockBins bin_triangles(const BinRequest& request) {
  BlockBins bins;
  std::vector<KeyedEntry> keyed;
  keyed.reserve(count_entries(request));
  for (std::uint32_t t = 0; t < request.mesh->triangles.size(); ++t) {
    if (request.triangle_page[t] == kNoPage) continue;
    for_each_block(
        request, t,
        [&](std::uint32_t page, const TriangleInstance& instance, std::int32_t x, std::int32_t y) {
          if (bins.instances.empty() || bins.instances.back().triangle != instance.triangle ||
              bins.instances.back().shift_x != instance.shift_x ||
              bins.instances.back().shift_y != instance.shift_y) {
            bins.instances.push_back(instance);
          }
          keyed.push_back({page, y, x, static_cast<std::uint32_t>(bins.instances.size() - 1)});
        });
  }
  std::sort(keyed.begin(), keyed.end());
  bins.entries.reserve(keyed.size());
  for (const KeyedEntry& entry : keyed) {
    if (bins.blocks.empty() || bins.blocks.back().page != entry.page ||
        bins.blocks.back().x != entry.x || bins.blocks.back().y != entry.y) {
      bins.blocks.push_back(
          {entry.page, entry.x, entry.y, static_cast<std::uint32_t>(bins.entries.size()), 0});
    }
    bins.entries.push_back(entry.instance);
    ++bins.blocks.back().count;
  }
  std::uint32_t first = 0;
  while (first < bins.blocks.size()) {  // a tile never mixes pages
    std::uint32_t count = 1;
    while (first + count < bins.blocks.size() &&
           bins.blocks[first + count].page == bins.blocks[first].page)
      ++count;
    split_tiles(bins, first, count, std::max<std::uint64_t>(request.tile_cap_bytes, 1));
    first += count;
  }
  return bins;
}

}  // namespace pounce::mesh
