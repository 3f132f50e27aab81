// SPDX-License-Identifier: Apache-2.0
#include "support/target_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

namespace pounce::test {
namespace {

constexpr long double kRounding = 1e-9L;  // of a texel; coordinates are below 2^13 here

struct Corner {
  long double x, y;
};

/// 1 inside, 0 outside, 2 or 3 the same but decided by rounding.
int inside(const std::array<Corner, 3>& c, long double x, long double y) {
  bool is_inside = true, unsure = false;
  for (std::size_t k = 0; k < 3; ++k) {
    const Corner &a = c[k], &b = c[(k + 1) % 3];
    const long double dx = b.x - a.x, dy = b.y - a.y;
    const long double e = dx * (y - a.y) - dy * (x - a.x);
    // Clockwise on the screen (y down), so the inside is where e > 0; a top edge runs to the
    // right, a left edge upwards.
    const bool top_left = dy < 0 || (dy == 0 && dx > 0);
    if (e < 0 || (e == 0 && !top_left)) is_inside = false;
    if (e < -kRounding * (std::abs(dx) + std::abs(dy))) return 0;
    if (e != 0 && e < kRounding * (std::abs(dx) + std::abs(dy))) unsure = true;
  }
  return (is_inside ? 1 : 0) + (unsure ? 2 : 0);
}

std::int64_t modulo(std::int64_t a, std::int64_t n) { return ((a % n) + n) % n; }

}  // namespace

TargetRaster raster_target(const mesh::Mesh& mesh, std::uint32_t width, std::uint32_t height) {
  TargetRaster out;
  out.width = width;
  out.height = height;
  const std::size_t texels = std::size_t{width} * height;
  out.owner.assign(texels, -1);
  out.x.assign(texels, 0);
  out.y.assign(texels, 0);
  out.on_edge.assign(texels, 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::array<Corner, 3> c;
    bool has_uv = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.triangles[t][k];
      has_uv = has_uv && mesh.has_uv(0, v);
      if (!has_uv) break;
      const Vec2f uv = mesh.uv_sets[0][v];
      c[k] = {static_cast<long double>(uv.x) * width - 0.5L,
              static_cast<long double>(uv.y) * height - 0.5L};
    }
    if (!has_uv) continue;
    const long double area =
        (c[1].x - c[0].x) * (c[2].y - c[0].y) - (c[1].y - c[0].y) * (c[2].x - c[0].x);
    if (area == 0) continue;
    if (area < 0) std::swap(c[1], c[2]);
    const auto [x0, x1] = std::minmax({c[0].x, c[1].x, c[2].x});
    const auto [y0, y1] = std::minmax({c[0].y, c[1].y, c[2].y});
    for (auto y = static_cast<std::int64_t>(std::floor(y0)); y <= std::ceil(y1); ++y) {
      for (auto x = static_cast<std::int64_t>(std::floor(x0)); x <= std::ceil(x1); ++x) {
        const int found = inside(c, static_cast<long double>(x), static_cast<long double>(y));
        const auto at = static_cast<std::size_t>(modulo(y, height) * width + modulo(x, width));
        if ((found & 2) != 0) out.on_edge[at] = 1;
        if ((found & 1) == 0 || out.owner[at] >= 0) continue;
        out.owner[at] = static_cast<std::int32_t>(t);
        out.x[at] = static_cast<double>(x);
        out.y[at] = static_cast<double>(y);
      }
    }
  }
  return out;
}

std::vector<std::uint32_t> charts(const mesh::Mesh& mesh) {
  std::vector<std::uint32_t> parent(mesh.triangles.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t t) {
    while (parent[t] != t) t = parent[t] = parent[parent[t]];
    return t;
  };
  using End = std::tuple<float, float, float, float, float>;
  std::map<std::pair<End, End>, std::uint32_t> first_with;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<End, 2> ends;
      for (std::size_t e = 0; e < 2; ++e) {
        const std::uint32_t v = mesh.triangles[t][(k + e) % 3];
        const Vec3f p = mesh.positions[v];
        const Vec2f uv = mesh.uv_sets[0][v];
        ends[e] = {p.x, p.y, p.z, uv.x, uv.y};
      }
      const auto [at, fresh] = first_with.try_emplace(std::minmax(ends[0], ends[1]), t);
      if (!fresh) parent[root(t)] = root(at->second);
    }
  }
  for (std::uint32_t t = 0; t < parent.size(); ++t) parent[t] = root(t);
  return parent;
}

std::vector<std::uint8_t> border_band(const mesh::Mesh& mesh, const TargetRaster& raster) {
  const std::vector<std::uint32_t> chart = charts(mesh);
  const auto chart_at = [&](std::int64_t x, std::int64_t y) -> std::int64_t {
    if (x < 0 || y < 0 || x >= raster.width || y >= raster.height) return -1;
    const std::int32_t owner = raster.owner[static_cast<std::size_t>(y * raster.width + x)];
    return owner < 0 ? -1 : std::int64_t{chart[static_cast<std::size_t>(owner)]};
  };
  std::vector<std::uint8_t> band(raster.owner.size(), 0);
  for (std::int64_t y = 0; y < raster.height; ++y) {
    for (std::int64_t x = 0; x < raster.width; ++x) {
      const std::int64_t own = chart_at(x, y);
      if (own < 0) continue;
      for (std::int64_t k = 0; k < 25; ++k) {
        if (chart_at(x + k % 5 - 2, y + k / 5 - 2) != own)
          band[static_cast<std::size_t>(y * raster.width + x)] = 1;
      }
    }
  }
  return band;
}

}  // namespace pounce::test
