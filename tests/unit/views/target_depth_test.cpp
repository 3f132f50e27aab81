// SPDX-License-Identifier: Apache-2.0
#include "views/target_depth.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <vector>

#include "support/random.h"

using namespace pounce;
using namespace pounce::views;
using namespace pounce::test;

namespace {

std::uint16_t sample(const std::vector<std::byte>& tile, int x, int y) {
  std::uint16_t out;
  std::memcpy(&out, tile.data() + 2 * ((y + kApron) * kStoredEdge + x + kApron), 2);
  return out;
}

}  // namespace

TEST_CASE("a target's nearest surface is its depth, whichever way it faces", "[views]") {
  const Grid grid({{-1, -1, -1}, {1, 1, 1}}, 1 / 64.0F, 24);
  REQUIRE(grid.tiles_across() % 2 == 0);
  const std::uint32_t view = 9, tile = grid.tiles_across() / 2;
  const Frame& f = grid.frame(view);
  // Two squares across the view, the nearer one half as wide and turned round; in whole steps.
  const auto at = [&](float x, float y, float depth) {
    return f.right * (x / 64) + f.down * (y / 64) + f.forward * (depth * grid.depth_step());
  };
  mesh::Mesh mesh;
  mesh.positions = {at(-40, -40, 900),  at(40, -40, 900),  at(40, 40, 900),  at(-40, 40, 900),
                    at(-20, -20, -500), at(20, -20, -500), at(20, 20, -500), at(-20, 20, -500)};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.rest = {{4, 6, 5}, {4, 7, 6}};  // of no part in the job, but in the way
  const TargetDepths drawn = draw_target(mesh, grid, view, 0, grid.tiles_across());
  const auto middle = drawn.tile(tile, tile);
  CHECK(std::abs(sample(middle, 5, 7) - (kMostDepth / 2 - 500)) <= 1);
  CHECK(std::abs(sample(middle, 30, 30) - (kMostDepth / 2 + 900)) <= 1);
  CHECK(sample(middle, 45, 5) == kNoDepth);
  // The left neighbour's last pixels are this one's apron.
  const auto left = drawn.tile(tile - 1, tile);
  CHECK(sample(left, 63, 7) == sample(middle, -1, 7));
  CHECK(sample(left, 64, 7) == sample(middle, 0, 7));
  CHECK(drawn.has(tile, tile));
  CHECK_FALSE(drawn.has(0, 0));

  SECTION("in bands it is the same") {
    for (std::uint32_t band : {1U, 3U}) {
      for (std::uint32_t y = 0; y < grid.tiles_across(); y += band) {
        const std::uint32_t rows = std::min(band, grid.tiles_across() - y);
        const TargetDepths part = draw_target(mesh, grid, view, y, rows);
        for (std::uint32_t r = y; r < y + rows; ++r) {
          for (std::uint32_t x = 0; x < grid.tiles_across(); ++x) {
            CHECK(part.has(x, r) == drawn.has(x, r));
            CHECK(part.tile(x, r) == drawn.tile(x, r));
          }
        }
      }
    }
  }
}

TEST_CASE("sloped triangles leave their plane's depth, and the nearest of many", "[views]") {
  const Grid grid({{-1, -1, -1}, {1, 1, 1}}, 1 / 32.0F, 24);
  Random random(5);
  mesh::Mesh mesh;
  for (std::uint32_t t = 0; t < 40; ++t) {
    for (int k = 0; k < 3; ++k)
      mesh.positions.push_back(
          {random.between(-0.9F, 0.9F), random.between(-0.9F, 0.9F), random.between(-0.9F, 0.9F)});
    mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  const std::uint32_t view = 4;
  const TargetDepths drawn = draw_target(mesh, grid, view, 0, grid.tiles_across());
  const Frame& f = grid.frame(view);
  std::size_t unlike = 0, pixels = 0;
  for (std::uint32_t ty = 0; ty < grid.tiles_across(); ++ty) {
    for (std::uint32_t tx = 0; tx < grid.tiles_across(); ++tx) {
      const auto tile = drawn.tile(tx, ty);
      for (int y = 0; y < kTileEdge; y += 5) {
        for (int x = 0; x < kTileEdge; x += 5, ++pixels) {
          // A ray against every triangle, in space.
          const double u = (double(tx * kTileEdge) + x - grid.edge() / 2.0 + 0.5) / 32,
                       v = (double(ty * kTileEdge) + y - grid.edge() / 2.0 + 0.5) / 32;
          const Vec3d from = Vec3d(f.right) * u + Vec3d(f.down) * v, way(f.forward);
          double nearest = 1e9;
          for (const auto& t : mesh.triangles) {
            const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
            const Vec3d e1 = b - a, e2 = c - a, p = cross(way, e2);
            const double det = dot(e1, p);
            const Vec3d s = from - a, q = cross(s, e1);
            const double b1 = dot(s, p) / det, b2 = dot(way, q) / det;
            if (b1 >= 0 && b2 >= 0 && b1 + b2 <= 1) nearest = std::min(nearest, dot(e2, q) / det);
          }
          const std::uint16_t found = sample(tile, x, y);
          if (nearest == 1e9) {
            unlike += found == kNoDepth ? 0 : 1;
          } else {
            const double expected =
                nearest / static_cast<double>(grid.depth_step()) + kMostDepth / 2;
            unlike += std::abs(found - expected) <= 2 ? 0 : 1;
          }
        }
      }
    }
  }
  CHECK(unlike <= pixels / 500);  // on edges rounding says which
}
