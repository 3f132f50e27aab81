// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/page_pool.h"
#include "core/vec.h"

namespace pounce::mesh {

// Which texel centres does a triangle cover? Shared edges must give each centre to exactly one of
// the two triangles, however the edge was rounded. Every edge function is computed from the edge's
// two ends in one order (the lexicographically smaller end first) and negated for the triangle that
// walks it backwards: both triangles see the same number with opposite signs, and a zero goes to
// one of them by the top-left rule. So no epsilon, no fixed-point grid: the coordinates stay what
// the file said.

/// Twice the signed area of a triangle in texels.
inline double doubled_area(Vec2d a, Vec2d b, Vec2d c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Half-open rectangle of texels [x0, x1) x [y0, y1).
struct TexelWindow {
  std::int64_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// One edge of a triangle with positive doubled area, evaluated at texel centres.
class EdgeFunction {
 public:
  EdgeFunction() = default;
  EdgeFunction(Vec2d from, Vec2d to) {
    const bool forward = from.x != to.x ? from.x < to.x : from.y < to.y;
    sign_ = forward ? 1.0 : -1.0;
    origin_ = forward ? from : to;
    const Vec2d end = forward ? to : from;
    dx_ = end.x - origin_.x;
    dy_ = end.y - origin_.y;
    const double walk_x = dx_ * sign_;
    const double walk_y = dy_ * sign_;
    top_left_ = walk_y < 0 || (walk_y == 0 && walk_x > 0);
  }
  bool inside(double x, double y) const {
    const double e = sign_ * (dx_ * (y - origin_.y) - dy_ * (x - origin_.x));
    return e > 0 || (e == 0 && top_left_);
  }
  /// The x where the edge crosses row y, approximately; slope_sign() says on which side the inside
  /// is.
  double crossing(double y) const { return origin_.x + dx_ * ((y - origin_.y) / dy_); }
  /// +1: inside to the right of the crossing, -1: to the left, 0: horizontal.
  int slope_sign() const {
    const double walk_y = dy_ * sign_;
    return walk_y < 0 ? 1 : walk_y > 0 ? -1 : 0;
  }

 private:
  Vec2d origin_{};
  double dx_ = 0, dy_ = 0, sign_ = 1;
  bool top_left_ = false;
};

/// std::floor() of what is below 2^40 in size, where no instruction does it.
inline std::int64_t whole_below(double value) {
  const auto towards_zero = static_cast<std::int64_t>(value);
  return towards_zero - (value < static_cast<double>(towards_zero) ? 1 : 0);
}

/// Calls span(y, x_begin, x_end) for every row of texel centres inside the triangle and the window,
/// top to bottom. Coordinates must be finite and below 2^40 in size. A triangle without area covers
/// nothing.
template <class SpanFunction>
void raster_triangle(const std::array<Vec2d, 3>& corners, const TexelWindow& window,
                     SpanFunction&& span) {
  const double area = doubled_area(corners[0], corners[1], corners[2]);
  if (!(area != 0)) return;
  const Vec2d a = corners[0];
  const Vec2d b = area > 0 ? corners[1] : corners[2];
  const Vec2d c = area > 0 ? corners[2] : corners[1];
  const double lowest_x = std::min({a.x, b.x, c.x}), highest_x = std::max({a.x, b.x, c.x});
  const double lowest_y = std::min({a.y, b.y, c.y}), highest_y = std::max({a.y, b.y, c.y});
  const auto first_x = std::max(window.x0, -whole_below(-lowest_x));
  const auto last_x = std::min(window.x1 - 1, whole_below(highest_x));
  if (first_x > last_x) return;  // beside the window: no range to guess in
  const auto first_y = std::max(window.y0, -whole_below(-lowest_y));
  const auto last_y = std::min(window.y1 - 1, whole_below(highest_y));
  if (first_y > last_y) return;  // between centres, as most of a dense mesh
  const std::array<EdgeFunction, 3> edges{EdgeFunction(a, b), EdgeFunction(b, c),
                                          EdgeFunction(c, a)};
  const bool is_narrow = last_x - first_x < 4;  // trying them all takes less than a guess

  for (std::int64_t y = first_y; y <= last_y; ++y) {
    const double row = static_cast<double>(y);
    std::int64_t begin = first_x;
    std::int64_t end = last_x;  // inclusive until the row is done
    for (const EdgeFunction& edge : edges) {
      const int side = edge.slope_sign();
      if (side == 0) {
        if (!edge.inside(lowest_x, row)) end = begin - 1;
        continue;
      }
      // The division only guesses; the exact predicate decides.
      const double guess = is_narrow
                               ? 0
                               : std::clamp(edge.crossing(row), static_cast<double>(first_x) - 2.0,
                                            static_cast<double>(last_x) + 2.0);
      if (side > 0) {
        if (!is_narrow) begin = std::max(begin, whole_below(guess) - 1);
        while (begin <= end && !edge.inside(static_cast<double>(begin), row)) ++begin;
      } else {
        if (!is_narrow) end = std::min(end, 1 - whole_below(-guess));
        while (end >= begin && !edge.inside(static_cast<double>(end), row)) --end;
      }
    }
    if (begin <= end) span(y, begin, end + 1);
  }
}

/// The x that a triangle has between two heights, these included; low > high: none.
struct Extent {
  double low = INFINITY, high = -INFINITY;
  void extend(double x) { low = std::min(low, x), high = std::max(high, x); }
};
Extent extent_between(const std::array<Vec2d, 3>& corners, double y0, double y1);

/// Do triangle and window (widened by `margin` texels on each side) overlap? May say yes for a near
/// miss.
bool triangle_touches(const std::array<Vec2d, 3>& corners, const TexelWindow& window,
                      double margin);

/// The UV triangles that claim texels of one image, of whatever size: what padding must not paint
/// over. Kept small (32 bytes a triangle) because it outlives the mesh. A texel is occupied when a
/// triangle covers its centre, by the rule and the arithmetic of the target's raster.
class UvOccupancy {
 public:
  /// UVs as Mesh has them, v down. Only the part in [tile_u, tile_u + 1) x [tile_v, tile_v + 1)
  /// counts.
  void add(const std::array<Vec2f, 3>& uv, std::int32_t tile_u, std::int32_t tile_v);
  /// Every part of the triangle counts, wrapped into one image. One that spans more than 65536
  /// periods is left out (and covers the image whole many times over; bin_triangles() refuses it).
  void add_wrapped(const std::array<Vec2f, 3>& uv);
  /// To be called once, after the last add.
  void finish();
  std::uint64_t size_bytes() const { return triangles_.capacity() * sizeof(Triangle); }

  /// Rows of one image of that size, from top to bottom.
  class Rows {
   public:
    Rows(const UvOccupancy& occupancy, std::uint32_t width, std::uint32_t height)
        : occupancy_(occupancy), width_(width), height_(height) {}
    /// The next `count` rows: sets occupied[row * width + x] to 1 or 0.
    void next(std::uint32_t count, std::uint8_t* occupied);

   private:
    const UvOccupancy& occupancy_;
    std::uint32_t width_, height_;
    std::uint32_t row_ = 0;
    std::size_t upcoming_ = 0;           ///< triangles before it have begun
    std::vector<std::uint32_t> active_;  ///< begun and not yet ended
  };

 private:
  struct Triangle {
    std::array<Vec2f, 3> uv;
    std::int32_t tile_u = 0, tile_v = 0;
    double top() const;
  };
  PageVector<Triangle> triangles_;  ///< by top(), once finished
};

}  // namespace pounce::mesh
