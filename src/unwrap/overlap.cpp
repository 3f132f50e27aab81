// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "unwrap/charts.h"

namespace pounce::unwrap {
namespace {

/// The area that two triangles have in common.
double common_area(const Vec2d* a, const Vec2d* b) {
  std::array<Vec2d, 10> polygon{a[0], a[1], a[2]}, next;
  std::size_t count = 3;
  const auto side = [](Vec2d p, Vec2d q, Vec2d r) {
    return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
  };
  const double sign = side(b[0], b[1], b[2]) < 0 ? -1 : 1;
  for (std::size_t k = 0; k < 3 && count > 0; ++k) {
    const Vec2d from = b[k], to = b[(k + 1) % 3];
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Vec2d p = polygon[i], q = polygon[(i + 1) % count];
      const double at_p = sign * side(from, to, p), at_q = sign * side(from, to, q);
      if (at_p >= 0) next[kept++] = p;
      if ((at_p < 0) != (at_q < 0)) {
        const double t = at_p / (at_p - at_q);
        next[kept++] = p + (q - p) * t;
      }
    }
    polygon.swap(next);
    count = kept;
  }
  double twice = 0;
  for (std::size_t i = 2; i < count; ++i) twice += side(polygon[0], polygon[i - 1], polygon[i]);
  return std::abs(twice) / 2;
}

/// Is what they have in common more than rounding makes of it?
bool in_common(const Vec2d* a, const Vec2d* b, double area_a, double area_b,
               double longest_squared) {
  const auto apart = [](double a0, double a1, double a2, double b0, double b1, double b2) {
    return std::max({a0, a1, a2}) < std::min({b0, b1, b2}) ||
           std::max({b0, b1, b2}) < std::min({a0, a1, a2});
  };
  if (apart(a[0].x, a[1].x, a[2].x, b[0].x, b[1].x, b[2].x) ||
      apart(a[0].y, a[1].y, a[2].y, b[0].y, b[1].y, b[2].y))
    return false;
  // All of the one beyond an edge of the other, whichever way that is turned: the most usual case
  // among neighbours.
  const auto beyond = [](const Vec2d* p, const Vec2d* q) {
    const auto side = [](Vec2d from, Vec2d to, Vec2d r) {
      return (to.x - from.x) * (r.y - from.y) - (to.y - from.y) * (r.x - from.x);
    };
    const double turn = side(p[0], p[1], p[2]) < 0 ? -1 : 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d from = p[k], to = p[(k + 1) % 3];
      if (turn * side(from, to, q[0]) <= 0 && turn * side(from, to, q[1]) <= 0 &&
          turn * side(from, to, q[2]) <= 0)
        return true;
    }
    return false;
  };
  if (beyond(a, b) || beyond(b, a)) return false;
  constexpr double kOfSmaller = 1e-3, kRounding = 1e-11;
  return common_area(a, b) > kOfSmaller * std::min(area_a, area_b) + kRounding * longest_squared;
}

}  // namespace

std::optional<std::pair<std::size_t, std::size_t>> find_overlap(const Chart& chart) {
  const std::size_t count = chart.triangles.size();
  if (count < 2) return std::nullopt;
  Vec2d low = chart.corners.front(), high = low;
  for (const Vec2d p : chart.corners) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  const double size = std::max(high.x - low.x, high.y - low.y);
  if (size == 0) return std::nullopt;
  const auto cells =
      static_cast<std::size_t>(std::clamp(std::sqrt(static_cast<double>(count)), 1.0, 1024.0));
  const double per_unit = static_cast<double>(cells) / size;
  const auto cell = [&](double v, double from) {
    return std::min(static_cast<std::size_t>(std::max((v - from) * per_unit, 0.0)), cells - 1);
  };
  std::vector<std::vector<std::uint32_t>> grid(cells * cells);
  std::vector<double> areas(count), lengths(count);  // the longest edge, squared
  for (std::size_t i = 0; i < count; ++i) {
    const Vec2d* const own = &chart.corners[3 * i];
    areas[i] = std::abs((own[1].x - own[0].x) * (own[2].y - own[0].y) -
                        (own[1].y - own[0].y) * (own[2].x - own[0].x)) /
               2;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d edge = own[(k + 1) % 3] - own[k];
      lengths[i] = std::max(lengths[i], edge.x * edge.x + edge.y * edge.y);
    }
    const double y0 = std::min({own[0].y, own[1].y, own[2].y}),
                 y1 = std::max({own[0].y, own[1].y, own[2].y});
    for (std::size_t y = cell(y0, low.y); y <= cell(y1, low.y); ++y) {
      auto [from, to] = span_between(own, low.y + static_cast<double>(y) / per_unit,
                                     low.y + static_cast<double>(y + 1) / per_unit);
      if (from > to) {  // by rounding alone: anywhere
        from = std::min({own[0].x, own[1].x, own[2].x});
        to = std::max({own[0].x, own[1].x, own[2].x});
      }
      // A cell more, since what lies on the line between two may be rounded to either.
      const std::size_t first = cell(from, low.x), last = cell(to, low.x);
      for (std::size_t x = first - (first > 0 ? 1 : 0); x <= std::min(last + 1, cells - 1); ++x) {
        for (const std::uint32_t j : grid[y * cells + x]) {
          if (j != i && in_common(own, &chart.corners[3 * j], areas[i], areas[j],
                                  std::max(lengths[i], lengths[j])))
            return std::pair(std::size_t{j}, i);
        }
        grid[y * cells + x].push_back(static_cast<std::uint32_t>(i));
      }
    }
  }
  return std::nullopt;
}

std::pair<double, double> span_between(const Vec2d* triangle, double y0, double y1) {
  double from = std::numeric_limits<double>::infinity(), to = -from;
  for (std::size_t k = 0; k < 3; ++k) {
    Vec2d a = triangle[k], b = triangle[(k + 1) % 3];
    if (a.y > b.y) std::swap(a, b);
    if (b.y < y0 || a.y > y1) continue;
    for (const double y : {std::max(a.y, y0), std::min(b.y, y1)}) {
      const double x = b.y > a.y ? a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)) : a.x;
      from = std::min(from, x);
      to = std::max(to, x);
    }
    if (b.y > a.y) continue;
    from = std::min(from, b.x);
    to = std::max(to, b.x);
  }
  return {from, to};
}

}  // namespace pounce::unwrap
