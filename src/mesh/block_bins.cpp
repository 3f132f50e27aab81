// SPDX-License-Identifier: Apache-2.0
//
// Which triangles touch which 64x64 window of texels, and which windows make a tile.
//
// Blocks are made from these bins, in any order and in parallel, so neither side needs an external
// shuffle. Binning goes through the triangles once to count entries by row of blocks, and once more
// for each band of rows, which is all that is in memory at a time; it passes over stretches of the
// file that the count found elsewhere. Tiles come from a k-d split over
// block coordinates: integers only, so the same on every machine. A tile's weight is an estimate of
// its stored bytes; it bounds a write buffer and sizes the index pages.
//
// Both sides ask "which blocks", and mean different things. A target's texel has one owner, so
// every block needs all triangles that may cover a texel of it, in each period of UV space that
// they reach into. A source's triangle is met by rays, wherever its texels are: one block is enough
// for a small one, and a large one is cut at block borders only to keep boxes small.
//
// Files order triangles as they like, so entries of one block come from anywhere. To sort all of
// them at once would need memory for all; so a band's worth is collected and sorted at a time, and
// the mesh is read through again for the next band. Counting comes first because of leases: a
// band's bytes are known before it is binned.
#include "mesh/block_bins.h"

#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <cmath>
#include <map>
#include <memory>
#include <tuple>
#include <utility>

#include "pounce/error.h"

namespace pounce::mesh {
namespace {

/// Of all bands of a request: more blocks than any texture set has, by far.
constexpr std::uint64_t kMostEntries = 1ULL << 32;
constexpr double kMostPeriods = 65536;        // of one triangle on a target
constexpr double kLargeShare = 1.0 / 256;     // of an image
constexpr std::uint32_t kConstantRun = 1024;  // triangles of a page without an image, per block
constexpr std::uint32_t kRunsPerRow = 256;    // blocks of such a page, per row

std::int32_t block_of(double texel) {
  return static_cast<std::int32_t>(whole_below(texel / kBlockEdge));
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

/// Calls visit(y, x0, x1), ends included, for each row of blocks of the range that the triangle
/// touches. A block counts as wider by a texel on each side, which is more than rounding can be
/// off.
template <class Visit>
void visit_rows(const std::array<Vec2d, 3>& corners, const BlockRange& range, const Visit& visit) {
  for (std::int32_t y = range.y0; y <= range.y1; ++y) {
    const double top = static_cast<double>(y) * kBlockEdge - 1;
    const Extent extent = extent_between(corners, top, top + kBlockEdge + 1);
    if (extent.low > extent.high) continue;
    // The first block whose last texel, and one more, is not before the triangle, and so on.
    const std::int32_t x0 =
        std::max(range.x0, static_cast<std::int32_t>(std::ceil(extent.low / kBlockEdge)) - 1);
    const std::int32_t x1 = std::min(range.x1, block_of(extent.high + 1));
    if (x0 <= x1) visit(y, x0, x1);
  }
}

/// Rows of blocks of one page, ends included.
struct RowRange {
  std::int32_t first = INT32_MIN, last = INT32_MAX;
  bool holds(std::int32_t y) const { return first <= y && y <= last; }
  bool meets(const BlockBands::Stretch& rows) const {
    return first <= rows.last && rows.first <= last;
  }
};

/// Where one triangle belongs on one page of a request, row by row of blocks.
class Placement {
 public:
  Placement(const BinRequest& request, std::uint32_t page, std::uint32_t triangle)
      : request_(request), lattice_(request.pages[page]), triangle_(triangle) {}

  /// Calls visit(instance, y, x0, x1) for every row of blocks among `rows` that it belongs to.
  template <class Visit>
  void visit_within(const RowRange& rows, const Visit& visit) {
    // A page without an image has no texel coordinates at all.
    if (lattice_.width == 0) return visit_run(rows, visit);
    measure();
    if (!request_.is_target) return visit_source(rows, visit);
    // Of a target it owns no texel; of a source it may still be hit, as it has area in space.
    if (doubled_area(corners_[0], corners_[1], corners_[2]) == 0) return;
    if (request_.tile)
      return visit_period(rows, request_.tile->column, period_y(*request_.tile), visit);
    // Periods in which some texel centre may be covered; a triangle wholly inside [0,1) has exactly
    // one.
    const double w = lattice_.width, h = lattice_.height;
    if (box_.lo.x >= 0 && box_.lo.y >= 0 && box_.hi.x <= w - 1 && box_.hi.y <= h - 1)
      return visit_period(rows, 0, 0, visit);  // nearly all of nearly every target
    const double x0 = std::floor(std::ceil(box_.lo.x) / w),
                 x1 = std::floor(std::floor(box_.hi.x) / w);
    const double y0 = std::floor(std::ceil(box_.lo.y) / h),
                 y1 = std::floor(std::floor(box_.hi.y) / h);
    if ((x1 - x0 + 1) * (y1 - y0 + 1) > kMostPeriods) fail_span(*request_.mesh, triangle_);
    for (double y = y0; y <= y1; ++y) {
      for (double x = x0; x <= x1; ++x)
        visit_period(rows, static_cast<std::int32_t>(x), static_cast<std::int32_t>(y), visit);
    }
  }

 private:
  void measure() {
    const auto& uvs = request_.mesh->uv_sets[lattice_.uv_set];
    for (std::size_t k = 0; k < 3; ++k)
      corners_[k] = to_texel(lattice_, uvs[request_.mesh->triangles[triangle_][k]]);
    box_ = box_of(corners_);
    if (!is_near(box_)) fail_span(*request_.mesh, triangle_);
  }

  /// No image, so no texels: runs of the file's order stand in for blocks.
  template <class Visit>
  void visit_run(const RowRange& rows, const Visit& visit) const {
    const std::uint32_t run = triangle_ / kConstantRun;
    const auto y = static_cast<std::int32_t>(run / kRunsPerRow);
    const auto x = static_cast<std::int32_t>(run % kRunsPerRow);
    if (rows.holds(y)) visit(TriangleInstance{triangle_, 0, 0}, y, x, x);
  }

  template <class Visit>
  void visit_source(const RowRange& rows, const Visit& visit) const {
    const TriangleInstance instance{triangle_, 0, 0};
    const BlockRange all{block_of(box_.lo.x), block_of(box_.lo.y), block_of(box_.hi.x),
                         block_of(box_.hi.y)};
    if (!is_whole(corners_, lattice_)) return visit_touched(rows, corners_, all, instance, visit);
    // Many small triangles to a texel: a block that says its surface in fewer needs those at its
    // border, too (shares_tiny).
    const HomeBlock home = home_block(corners_);
    const BlockRange blocks = request_.shares_tiny && is_tiny(corners_)
                                  ? all
                                  : BlockRange{home.x, home.y, home.x, home.y};
    for (std::int32_t y = blocks.y0; y <= blocks.y1; ++y) {
      if (rows.holds(y)) visit(instance, y, blocks.x0, blocks.x1);
    }
  }

  template <class Visit>
  void visit_period(const RowRange& rows, std::int32_t px, std::int32_t py,
                    const Visit& visit) const {
    const double w = lattice_.width, h = lattice_.height;
    const double sx = px * w, sy = py * h;
    const std::array<Vec2d, 3> moved{Vec2d{corners_[0].x - sx, corners_[0].y - sy},
                                     Vec2d{corners_[1].x - sx, corners_[1].y - sy},
                                     Vec2d{corners_[2].x - sx, corners_[2].y - sy}};
    const BlockRange range{
        block_of(std::max(box_.lo.x - sx, 0.0)), block_of(std::max(box_.lo.y - sy, 0.0)),
        block_of(std::min(box_.hi.x - sx, w - 1)), block_of(std::min(box_.hi.y - sy, h - 1))};
    visit_touched(rows, moved, range, {triangle_, px, py}, visit);
  }

  template <class Visit>
  static void visit_touched(const RowRange& rows, const std::array<Vec2d, 3>& corners,
                            BlockRange range, const TriangleInstance& instance,
                            const Visit& visit) {
    if (range.x0 == range.x1 && range.y0 == range.y1) {  // most triangles of a dense mesh
      if (rows.holds(range.y0)) visit(instance, range.y0, range.x0, range.x1);
      return;
    }
    range.y0 = std::max(range.y0, rows.first);
    range.y1 = std::min(range.y1, rows.last);
    // Row by row, since a slanted triangle touches few of the blocks in its box.
    visit_rows(corners, range, [&](std::int32_t y, std::int32_t x0, std::int32_t x1) {
      visit(instance, y, x0, x1);
    });
  }

  const BinRequest& request_;
  const Lattice& lattice_;
  const std::uint32_t triangle_;
  std::array<Vec2d, 3> corners_;
  Box2<double> box_;
};

/// How many triangles the fullest window has, page by page: of meshes that are worth it.
class WindowCounts {
 public:
  explicit WindowCounts(std::uint64_t triangles) : counts_(triangles > kFewTriangles) {}

  void begin(const Lattice& page) {
    columns_ = static_cast<std::int32_t>((page.width + kBlockEdge - 1) / kBlockEdge);
    rows_ = static_cast<std::int32_t>((page.height + kBlockEdge - 1) / kBlockEdge);
    beyond_ = 0;
    const auto windows = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
    of_window_.assign(counts_ ? windows : 0, 0);
  }
  void add(std::int32_t y, std::int32_t x0, std::int32_t x1) {
    if (!counts_) return;
    // Windows outside are as many as the UVs say: one number for all, which is no less than any's.
    for (std::int32_t x = x0; x <= x1; ++x) {
      const bool inside = x >= 0 && x < columns_ && y >= 0 && y < rows_;
      ++(inside ? of_window_[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) +
                             static_cast<std::size_t>(x)]
                : beyond_);
    }
  }
  void end() {
    most_ = std::max(most_, beyond_);
    for (const std::uint64_t count : of_window_) most_ = std::max(most_, count);
  }
  std::uint64_t most() const { return counts_ ? most_ : UINT64_MAX; }

 private:
  const bool counts_;
  std::int32_t columns_ = 0, rows_ = 0;
  PageVector<std::uint64_t> of_window_;
  std::uint64_t beyond_ = 0;  ///< in windows outside of the image, all together
  std::uint64_t most_ = 0;
};

/// Sorts by key(entry) of 0 to `most`: stable, digit by digit from the lowest; of one digit nearly
/// always, as there are few windows.
template <class Key>
void sort_by(PageVector<BinEntry>& entries, std::uint64_t most, const Key& key) {
  constexpr int kDigitBits = 13;
  constexpr std::uint64_t kLargest = (1 << kDigitBits) - 1;
  for (int shift = 0; shift < 64 && most >> shift != 0; shift += kDigitBits) {
    const auto digit = [&](const BinEntry& e) { return (key(e) >> shift) & kLargest; };
    std::vector<std::uint32_t> next(std::min(most >> shift, kLargest) + 1, 0);
    for (const BinEntry& entry : entries) ++next[digit(entry)];
    std::uint32_t sum = 0;
    for (std::uint32_t& first : next) sum += std::exchange(first, sum);
    PageVector<BinEntry> sorted(entries.size());
    for (const BinEntry& entry : entries) sorted[next[digit(entry)]++] = entry;
    entries.swap(sorted);
  }
}

/// By page, y, x; of one window as they were, in file order.
void sort_by_window(PageVector<BinEntry>& entries) {
  if (entries.empty()) return;
  BinEntry low = entries[0], high = low;
  for (const BinEntry& e : entries) {
    low.page = std::min(low.page, e.page), high.page = std::max(high.page, e.page);
    low.y = std::min(low.y, e.y), high.y = std::max(high.y, e.y);
    low.x = std::min(low.x, e.x), high.x = std::max(high.x, e.x);
  }
  const auto between = [](std::int32_t from, std::int32_t to) {
    return static_cast<std::uint64_t>(std::int64_t{to} - from);
  };
  const std::uint64_t columns = between(low.x, high.x) + 1;
  const auto window = [&](const BinEntry& e) {
    return between(low.y, e.y) * columns + between(low.x, e.x);
  };
  sort_by(entries, window(high), window);
  sort_by(entries, high.page - low.page,
          [&](const BinEntry& e) { return std::uint64_t{e.page - low.page}; });
}

/// Groups sorted entries into blocks.
void find_blocks(BlockBins& bins) {
  std::size_t count = 0;
  const auto starts = [&](std::size_t i) {
    const BinEntry& a = bins.entries[i];
    if (i == 0) return true;
    const BinEntry& b = bins.entries[i - 1];
    return a.page != b.page || a.y != b.y || a.x != b.x;
  };
  for (std::size_t i = 0; i < bins.entries.size(); ++i) count += starts(i);
  bins.blocks.reserve(count);
  bins.tiles.reserve(count);
  for (std::size_t i = 0; i < bins.entries.size(); ++i) {
    const BinEntry& entry = bins.entries[i];
    if (starts(i))
      bins.blocks.push_back({entry.page, entry.x, entry.y, static_cast<std::uint32_t>(i), 0});
    ++bins.blocks.back().count;
  }
}

/// Cuts blocks[first, first + count) until each part is light enough, reordering them: across the
/// longer side of their box, where about half of the weight is on each side. Sorts are stable, so
/// that tiles depend on the blocks alone.
void split_tiles(BlockBins& bins, std::uint32_t first, std::uint32_t count, std::uint64_t cap) {
  const auto weight = [](const BlockBin& b) {
    return 256 + kTileBytesPerTriangle * std::min<std::uint32_t>(b.count, 8192);
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
  // At least one block is on each side, or the recursion would not end.
  std::uint64_t left = 0;
  std::uint32_t cut = 0;
  while (cut + 1 < count && (cut == 0 || left + weight(begin[cut]) <= total / 2))
    left += weight(begin[cut++]);
  split_tiles(bins, first, cut, cap);
  split_tiles(bins, first + cut, count - cut, cap);
}

Vec2d sides_of(const std::array<Vec2d, 3>& corners) {
  const auto [lo, hi] = box_of(corners);
  return hi - lo;
}

}  // namespace

bool is_near(const Box2<double>& texels) {
  return std::abs(texels.lo.x) < kLargestTexel && std::abs(texels.hi.x) < kLargestTexel &&
         std::abs(texels.lo.y) < kLargestTexel && std::abs(texels.hi.y) < kLargestTexel;
}

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
  const Vec2d sides = sides_of(c);
  const double extent = std::max(sides.x, sides.y);
  if (extent <= kWholeTriangleTexels) return true;
  const double area = std::abs(doubled_area(c[0], c[1], c[2]));
  // Thin: its height over the longest side is below a texel, so cutting it gains nothing.
  return area < extent ||
         area >= 2 * kLargeShare * static_cast<double>(lattice.width) * lattice.height;
}

bool is_tiny(const std::array<Vec2d, 3>& c) {
  const Vec2d sides = sides_of(c);
  return sides.x < kTinyTriangleTexels && sides.y < kTinyTriangleTexels;
}

HomeBlock home_block(const std::array<Vec2d, 3>& c) {
  const auto [lo, hi] = box_of(c);
  return {block_of((lo.x + hi.x) / 2), block_of((lo.y + hi.y) / 2)};
}

BlockBands count_bands(const BinRequest& request) {
  return count_bands(request,
                     std::max<std::uint64_t>(kBandEntries, request.mesh->triangles.size() / 2));
}

BlockBands count_bands(const BinRequest& request, std::uint64_t band_entries) {
  BlockBands out;
  WindowCounts windows(request.mesh->triangles.size());
  std::map<std::int32_t, std::uint64_t> rows;  // of one page: how many entries each has
  for (std::uint32_t page = 0; page < request.pages.size(); ++page) {
    rows.clear();
    auto last = rows.end();  // neighbours in the file mostly touch the same row: no search then
    windows.begin(request.pages[page]);
    std::size_t number = 0;
    for (const std::uint32_t t : request.triangles->of(request.first_page + page)) {
      if (number++ % kTrianglesPerStretch == 0) out.stretches.emplace_back();
      BlockBands::Stretch& stretch = out.stretches.back();
      Placement(request, page, t)
          .visit_within(
              {}, [&](const TriangleInstance&, std::int32_t y, std::int32_t x0, std::int32_t x1) {
                if (last == rows.end() || last->first != y) last = rows.try_emplace(y, 0).first;
                const auto count = static_cast<std::uint64_t>(x1 - x0 + 1);
                last->second += count;
                stretch = {std::min(stretch.first, y), std::max(stretch.last, y)};
                windows.add(y, x0, x1);
                // Inside the visit: one triangle over many periods has billions of blocks.
                if ((out.entries += count) > kMostEntries) fail_span(*request.mesh, t);
              });
    }
    for (const auto& [y, count] : rows) {
      // A row is never divided, so one with more entries than a band should have is a band of its
      // own.
      if (out.bands.empty() || out.bands.back().entries + count > band_entries)
        out.bands.push_back({{page, y}, {page, y}, 0});
      out.bands.back().last = {page, y};
      out.bands.back().entries += count;
    }
    windows.end();
  }
  out.most_in_block = std::min(windows.most(), out.entries);
  return out;
}

BlockBinner::BlockBinner(const BinRequest& request, std::shared_ptr<const BlockBands> bands)
    : request_(request), bands_(std::move(bands)) {}

BlockBinner::BlockBinner(const BinRequest& request)
    : BlockBinner(request, std::make_shared<const BlockBands>(count_bands(request))) {}

std::uint64_t BlockBinner::most_entries() const {
  std::uint64_t most = 0;
  for (const BlockBands::Band& band : bands_->bands) most = std::max(most, band.entries);
  return most;
}

// Blocks and tiles are made when the copy that sorting needs is gone.
std::uint64_t BlockBinner::cost_bytes(std::uint64_t entries) {
  static_assert(sizeof(BlockBin) + sizeof(TileRange) >= sizeof(BinEntry));
  return entries * (sizeof(BinEntry) + sizeof(BlockBin) + sizeof(TileRange));
}

BlockBins BlockBinner::bin(std::size_t band) const {
  const BlockBands::Band& here = bands_->bands[band];
  BlockBins bins;
  bins.entries.reserve(here.entries);
  const auto triangles = [&](std::uint32_t page) {
    return request_.triangles->of(request_.first_page + page);
  };
  std::size_t stretch = 0;
  for (std::uint32_t page = 0; page < here.first.page; ++page)
    stretch += (triangles(page).size() + kTrianglesPerStretch - 1) / kTrianglesPerStretch;
  for (std::uint32_t page = here.first.page; page <= here.last.page; ++page) {
    RowRange rows;
    if (page == here.first.page) rows.first = here.first.y;
    if (page == here.last.page) rows.last = here.last.y;
    std::span<const std::uint32_t> left = triangles(page);
    while (!left.empty()) {
      const auto next = left.first(std::min(left.size(), kTrianglesPerStretch));
      left = left.subspan(next.size());
      if (!rows.meets(bands_->stretches[stretch++])) continue;
      for (const std::uint32_t t : next) {
        Placement(request_, page, t)
            .visit_within(rows, [&](const TriangleInstance& instance, std::int32_t y,
                                    std::int32_t x0, std::int32_t x1) {
              for (std::int32_t x = x0; x <= x1; ++x)
                bins.entries.push_back({page, y, x, instance});
            });
      }
    }
  }
  sort_by_window(bins.entries);
  find_blocks(bins);
  std::uint32_t first = 0;
  while (first < bins.blocks.size()) {  // a tile never mixes pages
    std::uint32_t count = 1;
    while (first + count < bins.blocks.size() &&
           bins.blocks[first + count].page == bins.blocks[first].page)
      ++count;
    split_tiles(bins, first, count, std::max<std::uint64_t>(request_.tile_cap_bytes, 1));
    first += count;
  }
  return bins;
}

}  // namespace pounce::mesh
