// SPDX-License-Identifier: Apache-2.0
//
// Triangles drawn one after the other; of a pixel's depths the least stays, so their order is
// nobody's concern. A triangle between the pixels' middles leaves none: its depth is that of its
// neighbours, but where it is alone texels on it are seen by no view.
#include "views/target_depth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>

namespace pounce::views {
namespace {

struct Corner {
  double x, y, depth;
};

/// Beyond every pixel.
constexpr double kFar = 1e9;
/// As std::ceil() and std::floor(), which are calls, of what may be a pixel. What is no number
/// bounds nothing.
double ceil_of(double v) {
  v = v > -kFar ? v : -kFar;
  const auto whole = static_cast<double>(static_cast<std::int64_t>(v < kFar ? v : kFar));
  return whole < v ? whole + 1 : whole;
}
double floor_of(double v) {
  v = v < kFar ? v : kFar;
  const auto whole = static_cast<double>(static_cast<std::int64_t>(v > -kFar ? v : -kFar));
  return whole > v ? whole - 1 : whole;
}

void draw(const std::array<Corner, 3>& corners, bool faces, TargetDepths& out) {
  const Corner &a = corners[0], &b = corners[1], &c = corners[2];
  const double last = out.row - 1.0, last_y = static_cast<double>(out.samples.size() / out.row) - 1;
  const double x0 = std::max(ceil_of(std::min({a.x, b.x, c.x})), 0.0),
               x1 = std::min(floor_of(std::max({a.x, b.x, c.x})), last),
               y0 = std::max(ceil_of(std::min({a.y, b.y, c.y})), 0.0),
               y1 = std::min(floor_of(std::max({a.y, b.y, c.y})), last_y);
  if (!(x0 <= x1 && y0 <= y1)) return;
  const double area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  if (!(std::abs(area) > 0)) return;
  // Shares of b and c, and the depth, are affine in x and y.
  const double bx = (c.y - a.y) / area, by = -(c.x - a.x) / area, cx = -(b.y - a.y) / area,
               cy = (b.x - a.x) / area;
  const double depth_x = bx * (b.depth - a.depth) + cx * (c.depth - a.depth),
               depth_y = by * (b.depth - a.depth) + cy * (c.depth - a.depth);
  constexpr double kOutside = 1e-9;  // what lies on an edge belongs to both sides
  // Where a share is 0: at an x that is affine in y. On rising shares all right of it is inside.
  struct Edge {
    double x = 0, per_y = 0;
    double share = 0, share_y = 0;  // where it is the same along a row
    double rises = 0;
  };
  std::array<Edge, 3> edges;
  const auto set = [&](Edge& edge, double at_a, double per_x, double per_y) {
    edge.rises = per_x;
    if (per_x != 0) {
      edge.x = a.x - (at_a + kOutside) / per_x;
      edge.per_y = -per_y / per_x;
    } else {
      edge.share = at_a;
      edge.share_y = per_y;
    }
  };
  set(edges[0], 0, bx, by);
  set(edges[1], 0, cx, cy);
  set(edges[2], 1, -(bx + cx), -(by + cy));
  for (double y = y0; y <= y1; ++y) {
    // Where all three shares are at least 0: a span of the row.
    double low = x0, high = x1;
    const double down = y - a.y;
    for (const Edge& edge : edges) {
      const double zero = edge.x + edge.per_y * down;
      if (edge.rises > 0) low = std::max(low, ceil_of(zero));
      if (edge.rises < 0) high = std::min(high, floor_of(zero));
      if (edge.rises == 0 && edge.share + edge.share_y * down < -kOutside) high = low - 1;
    }
    if (!(low <= high)) continue;
    const std::size_t row = static_cast<std::size_t>(y) * out.row;
    std::uint16_t *const all = out.samples.data() + row, *const facing = out.facing.data() + row;
    double depth = a.depth + depth_y * down + depth_x * (low - a.x) + 0.5;
    for (auto x = static_cast<std::size_t>(low); x <= static_cast<std::size_t>(high); ++x) {
      const auto steps =
          static_cast<std::uint16_t>(std::clamp(depth, 0.0, static_cast<double>(kMostDepth)));
      all[x] = std::min(all[x], steps);
      if (faces) facing[x] = std::min(facing[x], steps);
      depth += depth_x;
    }
  }
}

}  // namespace

TargetDepths draw_target(const mesh::Mesh& mesh, const Grid& grid, std::uint32_t view,
                         std::uint32_t first_tile_y, std::uint32_t tile_rows) {
  TargetDepths out;
  out.first_tile_y = first_tile_y;
  out.tile_rows = tile_rows;
  out.row = grid.edge() + 2 * kApron;
  out.samples.resize(std::size_t{out.row} * (tile_rows * kTileEdge + 2 * kApron));
  std::fill(out.samples.begin(), out.samples.end(), kNoDepth);
  out.facing.resize(out.samples.size());
  std::fill(out.facing.begin(), out.facing.end(), kNoDepth);
  const double above = static_cast<double>(first_tile_y * kTileEdge) - kApron;
  const auto corner = [&](std::uint32_t vertex) {
    const Seen seen = grid.see(view, mesh.positions[vertex]);
    return Corner{double{seen.x} + kApron, double{seen.y} - above, double{seen.depth}};
  };
  for (const auto* triangles : {&mesh.triangles, &mesh.rest}) {
    for (const auto& t : *triangles) {
      const Vec3f normal = mesh.normals[t[0]] + mesh.normals[t[1]] + mesh.normals[t[2]];
      const bool faces = dot(normal, grid.frame(view).forward) < 0;
      draw({corner(t[0]), corner(t[1]), corner(t[2])}, faces, out);
    }
  }
  return out;
}

bool TargetDepths::has(std::uint32_t tile_x, std::uint32_t tile_y) const {
  for (std::size_t y = 0; y < kStoredEdge; ++y) {
    const std::uint16_t* const first = samples.data() + at(tile_x, tile_y, y);
    if (std::any_of(first, first + kStoredEdge, [](std::uint16_t d) { return d != kNoDepth; }))
      return true;
  }
  return false;
}

std::vector<std::byte> TargetDepths::tile(std::uint32_t tile_x, std::uint32_t tile_y) const {
  constexpr std::size_t kRowBytes = kStoredEdge * sizeof(std::uint16_t);
  std::vector<std::byte> out(kStoredEdge * kRowBytes);
  for (std::size_t y = 0; y < kStoredEdge; ++y)
    std::memcpy(out.data() + y * kRowBytes, samples.data() + at(tile_x, tile_y, y), kRowBytes);
  return out;
}

std::vector<std::byte> TargetDepths::inside(std::uint32_t tile_x, std::uint32_t tile_y,
                                            float gap) const {
  constexpr std::size_t kPixels = std::size_t{kStoredEdge} * kStoredEdge, kLeast = kPixels / 50;
  std::vector<std::uint16_t> depths(kPixels, kNoDepth);
  std::size_t count = 0;
  for (std::size_t y = 0; y < kStoredEdge; ++y) {
    const std::size_t first = at(tile_x, tile_y, y);
    for (std::size_t x = 0; x < kStoredEdge; ++x) {
      const std::uint16_t nearest = samples[first + x], front = facing[first + x];
      if (front == kNoDepth || static_cast<float>(front - nearest) <= gap) continue;
      depths[y * kStoredEdge + x] = front;
      ++count;
    }
  }
  if (count < kLeast) return {};
  const auto bytes = std::as_bytes(std::span(depths));
  return {bytes.begin(), bytes.end()};
}

}  // namespace pounce::views
