// SPDX-License-Identifier: Apache-2.0
//
// Which tiles of an image a mesh shows.
//
// A triangle goes on where it leaves the image, as its UVs do; its texels come back as the wrap
// mode says. It is cut into bands as high as a tile; each gives a rectangle of texels, which is
// brought into the image as intervals: one that crosses the image's border as two, one that is
// longer than the image as all of it.
//
// A tile too many costs time and disk. A tile too few means that the whole image is built after
// all, when a texel asks for it (flow/stores/block_readers.h). So all rounding is outwards, and the
// margin covers what filters and levels read beside a triangle.
#include "mesh/lattice.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mesh/block_bins.h"
#include "mesh/uv_raster.h"

namespace pounce::mesh {
namespace {

/// Texels, both ends included.
struct Interval {
  std::uint32_t first = 0, last = 0;
};

/// Where an interval of texel coordinates comes to lie in an image: in one or two intervals.
struct Wrapped {
  std::array<Interval, 2> parts;
  std::size_t count = 0;

  void add(std::int64_t first, std::int64_t last) {
    parts[count++] = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last)};
  }
  const Interval* begin() const { return parts.data(); }
  const Interval* end() const { return parts.data() + count; }
};

Wrapped wrapped(double low, double high, std::uint32_t size, Wrap wrap) {
  const auto first = static_cast<std::int64_t>(std::floor(low)),
             last = static_cast<std::int64_t>(std::ceil(high));
  const std::int64_t end = size;
  Wrapped out;
  if (wrap == Wrap::clamp) {
    out.add(std::clamp<std::int64_t>(first, 0, end - 1),
            std::clamp<std::int64_t>(last, 0, end - 1));
  } else if (first >= 0 && last < end) {
    out.add(first, last);
    // Clamped and inner intervals are one; of repeated ones what leaves one side enters the other.
  } else if (wrap == Wrap::mirror || last - first + 1 >= end) {  // few are mirrored: all of it
    out.add(0, end - 1);
  } else {
    const std::int64_t from = ((first % end) + end) % end, to = from + (last - first);
    out.add(from, std::min(to, end - 1));
    if (to >= end) out.add(0, to - end);
  }
  return out;
}

}  // namespace

TileMask::TileMask(std::uint32_t width, std::uint32_t height)
    : width_(width),
      height_(height),
      tiles_x_((width + kBlockEdge - 1) / kBlockEdge),
      tiles_y_((height + kBlockEdge - 1) / kBlockEdge),
      tiles_(std::size_t{tiles_x_} * tiles_y_, 0) {}

std::uint64_t TileMask::count() const {
  return static_cast<std::uint64_t>(std::count(tiles_.begin(), tiles_.end(), 1));
}

bool TileMask::has_row(std::uint32_t y) const {
  const auto row = tiles_.begin() + static_cast<std::ptrdiff_t>(at(0, y));
  return std::find(row, row + tiles_x_, 1) != row + tiles_x_;
}

// Readers stop there: an image that decodes from the top is not decoded to its end for nothing.
std::uint32_t TileMask::end_row() const {
  std::uint32_t end = tiles_y_;
  while (end > 0 && !has_row(end - 1)) --end;
  return end;
}

void TileMask::add(std::uint32_t x0, std::uint32_t x1, std::uint32_t y0, std::uint32_t y1) {
  for (std::uint32_t y = y0 / kBlockEdge; y <= y1 / kBlockEdge; ++y) {
    std::fill(tiles_.begin() + static_cast<std::ptrdiff_t>(at(x0 / kBlockEdge, y)),
              tiles_.begin() + static_cast<std::ptrdiff_t>(at(x1 / kBlockEdge, y)) + 1,
              std::uint8_t{1});
  }
}

void TileMask::add_all() { std::fill(tiles_.begin(), tiles_.end(), std::uint8_t{1}); }

void add_touched(const Mesh& mesh, const Lattice& lattice, std::span<const std::uint32_t> triangles,
                 Wrap wrap_u, Wrap wrap_v, double margin, TileMask& mask) {
  for (const std::uint32_t triangle : triangles) {
    const std::array<Vec2d, 3> corners = texel_corners(mesh, lattice, {triangle, 0, 0});
    const Box2<double> box = box_of(corners);
    if (!is_near(box)) {  // refused where triangles are binned
      mask.add_all();
      continue;
    }
    // Bands of the triangle's own, as high as a tile: no two share a row.
    // The box of a long slanted triangle would be most of the image.
    for (double top = box.lo.y; top <= box.hi.y; top += kBlockEdge) {
      const double bottom = std::min(top + kBlockEdge, box.hi.y);
      const Extent extent = extent_between(corners, top, bottom);
      if (extent.low > extent.high) continue;
      const Wrapped rows = wrapped(top - margin, bottom + margin, lattice.height, wrap_v);
      for (const Interval& x :
           wrapped(extent.low - margin, extent.high + margin, lattice.width, wrap_u)) {
        for (const Interval& y : rows) mask.add(x.first, x.last, y.first, y.last);
      }
    }
  }
}

double texel_area(const Mesh& mesh, const Lattice& lattice,
                  std::span<const std::uint32_t> triangles) {
  double doubled = 0;
  for (const std::uint32_t triangle : triangles) {
    const std::array<Vec2d, 3> corners = texel_corners(mesh, lattice, {triangle, 0, 0});
    doubled += std::abs(doubled_area(corners[0], corners[1], corners[2]));
  }
  return doubled / 2;
}

}  // namespace pounce::mesh
