// SPDX-License-Identifier: Apache-2.0
#include "mesh/uv_raster.h"

namespace pounce::mesh {

Extent extent_between(const std::array<Vec2d, 3>& corners, double y0, double y1) {
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
  const auto [low_x, high_x] = std::minmax({corners[0].x, corners[1].x, corners[2].x});
  const auto [low_y, high_y] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
  if (high_x < x0 || low_x > x1 || high_y < y0 || low_y > y1) return false;

  // Separating axis: an edge that has the whole window on its outer side.
  const double area = (corners[1].x - corners[0].x) * (corners[2].y - corners[0].y) -
                      (corners[1].y - corners[0].y) * (corners[2].x - corners[0].x);
  if (area == 0) return true;
  const double sign = area > 0 ? 1 : -1;
  for (int i = 0; i < 3; ++i) {
    const Vec2d from = corners[static_cast<std::size_t>(i)];
    const Vec2d to = corners[static_cast<std::size_t>((i + 1) % 3)];
    const double dx = (to.x - from.x) * sign;
    const double dy = (to.y - from.y) * sign;
    const double far_x = dy > 0 ? x0 : x1;  // the window's corner that lies farthest inside
    const double far_y = dx > 0 ? y1 : y0;
    const double scale = std::abs(dx) * (std::abs(far_y) + std::abs(from.y)) +
                         std::abs(dy) * (std::abs(far_x) + std::abs(from.x));
    if (dx * (far_y - from.y) - dy * (far_x - from.x) < -1e-12 * scale) return false;
  }
  return true;
}

}  // namespace pounce::mesh
