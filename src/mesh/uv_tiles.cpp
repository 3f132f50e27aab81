// SPDX-License-Identifier: Apache-2.0
//
// Which unit squares of UV space a triangle shares area with. Its box holds them all, but a long
// triangle across a row of tiles has most of its box empty, and a tile too many is an image too
// many. So each square is cut out of the triangle (Sutherland and Hodgman) and what is left is
// measured. One that only touches a border, as charts at the edge of a tile do, shares no area.
#include "mesh/uv_tiles.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/bounds.h"

namespace pounce::mesh {
namespace {

constexpr double kMostTiles = 65536;

/// Keeps the part of a convex polygon where side * (coordinate - at) >= 0.
template <class Coordinate>
void clip(std::vector<Vec2d>& polygon, double at, double side, Coordinate coordinate) {
  std::vector<Vec2d> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec2d& a = polygon[i];
    const Vec2d& b = polygon[(i + 1) % polygon.size()];
    const double da = side * (coordinate(a) - at), db = side * (coordinate(b) - at);
    if (da >= 0) kept.push_back(a);
    if ((da < 0) != (db < 0)) {
      const double s = da / (da - db);
      kept.push_back({a.x + s * (b.x - a.x), a.y + s * (b.y - a.y)});
    }
  }
  polygon = std::move(kept);
}

double area(const std::vector<Vec2d>& polygon) {
  double doubled = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec2d& a = polygon[i];
    const Vec2d& b = polygon[(i + 1) % polygon.size()];
    doubled += a.x * b.y - a.y * b.x;
  }
  return std::abs(doubled) / 2;
}

/// Does the triangle share area with the unit square at (x, y)?
bool enters(const std::array<Vec2d, 3>& uvs, double x, double y) {
  // Relative to the square, so that small overlaps keep their digits.
  std::vector<Vec2d> polygon;
  for (const Vec2d& uv : uvs) polygon.push_back({uv.x - x, uv.y - y});
  const auto u = [](const Vec2d& p) { return p.x; };
  const auto v = [](const Vec2d& p) { return p.y; };
  clip(polygon, 0, 1, u);
  clip(polygon, 1, -1, u);
  clip(polygon, 0, 1, v);
  clip(polygon, 1, -1, v);
  return polygon.size() >= 3 &&
         area(polygon) > 1e-12;  // a millionth of a texel's edge at 1e6 texels
}

}  // namespace

std::optional<std::uint32_t> udim_number(UvTile tile) {
  if (tile.column < 0 || tile.column >= kUdimColumns || tile.row < 0) return std::nullopt;
  const std::int64_t number =
      std::int64_t{kFirstUdim} + tile.column + std::int64_t{kUdimColumns} * tile.row;
  if (number > kLastUdim) return std::nullopt;
  return static_cast<std::uint32_t>(number);
}

UvTile udim_tile(std::uint32_t udim) {
  const auto index = static_cast<std::int32_t>(udim - kFirstUdim);
  return {index % kUdimColumns, index / kUdimColumns};
}

std::string uvtile_name(UvTile tile) {
  return "u" + std::to_string(tile.column + 1) + "_v" + std::to_string(tile.row + 1);
}

std::string udim_list(const std::vector<std::uint32_t>& sorted) {
  std::string text;
  for (std::size_t i = 0; i < sorted.size();) {
    std::size_t end = i + 1;
    while (end < sorted.size() && sorted[end] == sorted[end - 1] + 1) ++end;
    text += (text.empty() ? "" : ", ") + std::to_string(sorted[i]);
    if (end - i > 2) text += "-" + std::to_string(sorted[end - 1]);
    if (end - i == 2) text += ", " + std::to_string(sorted[end - 1]);
    i = end;
  }
  return text;
}

std::uint64_t visit_uv_tiles(const std::array<Vec2d, 3>& uvs,
                             const std::function<void(UvTile)>& visit) {
  const auto [lo, hi] = box_of(uvs);
  // NaN ends here, too.
  if (!(hi.x > lo.x && hi.y > lo.y)) return 0;
  const double x0 = std::floor(lo.x), x1 = std::ceil(hi.x) - 1;
  const double y0 = std::floor(lo.y), y1 = std::ceil(hi.y) - 1;
  const double tiles = (x1 - x0 + 1) * (y1 - y0 + 1);
  // A stray coordinate: counted, so that the message can say how many, and not visited.
  if (tiles > kMostTiles || std::max({-x0, x1, -y0, y1}) > 1e9)
    return static_cast<std::uint64_t>(std::min(std::max(tiles, kMostTiles + 1), 1e18));
  std::uint64_t count = 0;
  for (double y = y0; y <= y1; ++y) {
    for (double x = x0; x <= x1; ++x) {
      if (!enters(uvs, x, y)) continue;
      ++count;
      visit(tile_of_period(static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)));
    }
  }
  return count;
}

}  // namespace pounce::mesh
