// SPDX-License-Identifier: Apache-2.0
//
// Which texels a triangle covers is decided in the header, exactly. Here is what may err on the
// safe side (which windows it touches), and the occupancy of an image: a target's images are padded
// after its mesh has gone, row by row, so what is kept is the UVs alone, sorted by where they
// begin. A sweep from top to bottom then holds only the triangles that the current rows cut.
//
// The safe side is one of two: a window that is wrongly counted as touched costs a test, one that
// is wrongly left out is a hole in the surface.
#include "mesh/uv_raster.h"

#include <cstring>

#include "core/bounds.h"
#include "mesh/lattice.h"

namespace pounce::mesh {
namespace {

constexpr double kMostPeriods = 65536;
constexpr double kLargestUv = 1e9;

/// The last period that [.., high] has an inner point of.
double last_period(double low, double high) {
  return std::max(std::floor(low), std::ceil(high) - 1);
}

}  // namespace

Extent extent_between(const std::array<Vec2d, 3>& corners, double y0, double y1) {
  // The part between two heights is convex: its corners are those of the triangle that lie there
  // and where edges cross the two lines.
  Extent extent;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2d a = corners[k], b = corners[(k + 1) % 3];
    if (a.y >= y0 && a.y <= y1) extent.extend(a.x);
    for (const double y : {y0, y1}) {
      if ((a.y < y) != (b.y < y)) extent.extend(a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)));
    }
  }
  return extent;
}

bool triangle_touches(const std::array<Vec2d, 3>& corners, const TexelWindow& window,
                      double margin) {
  const double x0 = static_cast<double>(window.x0) - margin;
  const double x1 = static_cast<double>(window.x1) - 1 + margin;
  const double y0 = static_cast<double>(window.y0) - margin;
  const double y1 = static_cast<double>(window.y1) - 1 + margin;
  const Box2<double> box = box_of(corners);
  if (box.hi.x < x0 || box.lo.x > x1 || box.hi.y < y0 || box.lo.y > y1) return false;

  // Separating axis: an edge that has the whole window on its outer side.
  const double area = doubled_area(corners[0], corners[1], corners[2]);
  if (area == 0) return true;
  const double sign = area > 0 ? 1 : -1;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec2d from = corners[i], to = corners[(i + 1) % 3];
    const double dx = (to.x - from.x) * sign;
    const double dy = (to.y - from.y) * sign;
    const double far_x = dy > 0 ? x0 : x1;  // the window's corner that lies farthest inside
    const double far_y = dx > 0 ? y1 : y0;
    // What rounding may make of zero, for numbers of this size: touching counts as overlapping.
    const double scale = std::abs(dx) * (std::abs(far_y) + std::abs(from.y)) +
                         std::abs(dy) * (std::abs(far_x) + std::abs(from.x));
    if (dx * (far_y - from.y) - dy * (far_x - from.x) < -1e-12 * scale) return false;
  }
  return true;
}

double UvOccupancy::Triangle::top() const {
  return static_cast<double>(std::min({uv[0].y, uv[1].y, uv[2].y})) - tile_v;
}

void UvOccupancy::add(const std::array<Vec2f, 3>& uv, std::int32_t tile_u, std::int32_t tile_v) {
  triangles_.push_back({uv, tile_u, tile_v});
}

void UvOccupancy::add_wrapped(const std::array<Vec2f, 3>& uv) {
  const auto [lo, hi] = box_of(uv);
  const double largest = std::max({std::abs(lo.x), std::abs(hi.x), std::abs(lo.y), std::abs(hi.y)});
  if (!(largest < kLargestUv)) return;
  const double first_u = std::floor(lo.x), last_u = last_period(lo.x, hi.x);
  const double first_v = std::floor(lo.y), last_v = last_period(lo.y, hi.y);
  if ((last_u - first_u + 1) * (last_v - first_v + 1) > kMostPeriods) return;
  for (double v = first_v; v <= last_v; ++v) {
    for (double u = first_u; u <= last_u; ++u)
      add(uv, static_cast<std::int32_t>(u), static_cast<std::int32_t>(v));
  }
}

void UvOccupancy::finish() {
  // By where they begin, in UVs: the same order at every size of image.
  triangles_.shrink_to_fit();
  std::sort(triangles_.begin(), triangles_.end(),
            [](const Triangle& a, const Triangle& b) { return a.top() < b.top(); });
}

void UvOccupancy::Rows::next(std::uint32_t count, std::uint8_t* occupied) {
  std::memset(occupied, 0, std::size_t{count} * width_);
  const auto& triangles = occupancy_.triangles_;
  const Lattice lattice{width_, height_, 0, {}};
  const std::uint32_t end = row_ + count;
  // They are in the order of their tops, so the first that begins below these rows ends the walk.
  while (upcoming_ < triangles.size() &&
         triangles[upcoming_].top() * height_ - 0.5 < static_cast<double>(end)) {
    active_.push_back(static_cast<std::uint32_t>(upcoming_++));
  }
  const TexelWindow window{0, row_, width_, end};
  // Drawn into these rows; gone once it ends above the next ones.
  std::erase_if(active_, [&](std::uint32_t index) {
    const Triangle& triangle = triangles[index];
    std::array<Vec2d, 3> corners;
    double bottom = -INFINITY;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = to_texel(lattice, triangle.uv[k]);
      corners[k].x -= static_cast<double>(triangle.tile_u) * width_;
      corners[k].y -= static_cast<double>(triangle.tile_v) * height_;
      bottom = std::max(bottom, corners[k].y);
    }
    raster_triangle(corners, window, [&](std::int64_t y, std::int64_t from, std::int64_t to) {
      std::memset(occupied + static_cast<std::size_t>(y - row_) * width_ + from, 1,
                  static_cast<std::size_t>(to - from));
    });
    return bottom < static_cast<double>(end);
  });
  row_ = end;
}

}  // namespace pounce::mesh
