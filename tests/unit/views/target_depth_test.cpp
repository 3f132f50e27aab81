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
  // The nearer one is seen from behind.
  for (int i = 0; i < 8; ++i) mesh.normals.push_back(i < 4 ? f.forward * -1.0F : f.forward);
  const TargetDepths drawn = draw_target(mesh, grid, view, 0, grid.tiles_across());
  const auto middle = drawn.tile(tile, tile);
  CHECK(std::abs(sample(middle, 5, 7) - (kMostDepth / 2 - 500)) <= 1);
  CHECK(std::abs(sample(middle, 30, 30) - (kMostDepth / 2 + 900)) <= 1);
  CHECK(sample(middle, 45, 5) == kNoDepth);
  // In a doll's house the nearer one is away; where it was not, nothing is seen that was not
  // before.
  const auto inside = drawn.inside(tile, tile, 1399);
  CHECK(std::abs(sample(inside, 5, 7) - (kMostDepth / 2 + 900)) <= 1);
  CHECK(sample(inside, 30, 30) == kNoDepth);
  CHECK(sample(inside, 45, 5) == kNoDepth);
  CHECK(drawn.inside(tile, tile, 1401).empty());  // it is not far enough before the other
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
            CHECK(part.inside(x, r, 9) == drawn.inside(x, r, 9));
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
    const Vec3f across = cross(mesh.positions[3 * t + 1] - mesh.positions[3 * t],
                               mesh.positions[3 * t + 2] - mesh.positions[3 * t]);
    // Normals say which way it faces, however its corners lie.
    const Vec3f normal = across * (random.one_in(2) ? 1 / length(across) : -1 / length(across));
    mesh.normals.insert(mesh.normals.end(), 3, normal);
  }
  constexpr float kGap = 200;
  std::size_t inside_pixels = 0;
  const std::uint32_t view = 4;
  const TargetDepths drawn = draw_target(mesh, grid, view, 0, grid.tiles_across());
  const Frame& f = grid.frame(view);
  std::size_t unlike = 0, pixels = 0;
  for (std::uint32_t ty = 0; ty < grid.tiles_across(); ++ty) {
    for (std::uint32_t tx = 0; tx < grid.tiles_across(); ++tx) {
      const auto tile = drawn.tile(tx, ty), inside = drawn.inside(tx, ty, kGap);
      for (int y = 0; y < kTileEdge; y += 5) {
        for (int x = 0; x < kTileEdge; x += 5, ++pixels) {
          // A ray against every triangle, in space.
          const double u = (double(tx * kTileEdge) + x - grid.edge() / 2.0 + 0.5) / 32,
                       v = (double(ty * kTileEdge) + y - grid.edge() / 2.0 + 0.5) / 32;
          const Vec3d from = Vec3d(f.right) * u + Vec3d(f.down) * v, way(f.forward);
          double nearest = 1e9, front = 1e9;
          for (const auto& t : mesh.triangles) {
            const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
            const Vec3d e1 = b - a, e2 = c - a, p = cross(way, e2);
            const double det = dot(e1, p);
            const Vec3d s = from - a, q = cross(s, e1);
            const double b1 = dot(s, p) / det, b2 = dot(way, q) / det;
            if (!(b1 >= 0 && b2 >= 0 && b1 + b2 <= 1)) continue;
            nearest = std::min(nearest, dot(e2, q) / det);
            if (dot(Vec3d(mesh.normals[t[0]]), way) < 0) front = std::min(front, dot(e2, q) / det);
          }
          if (!inside.empty()) {
            const double gap = (front - nearest) / static_cast<double>(grid.depth_step());
            const std::uint16_t found = sample(inside, x, y);
            const bool is_inside = front < 1e9 && gap > double{kGap};
            inside_pixels += is_inside ? 1 : 0;
            const double expected =
                is_inside ? front / static_cast<double>(grid.depth_step()) + kMostDepth / 2
                          : double{kNoDepth};
            unlike += std::abs(found - expected) <= 2 || std::abs(gap - double{kGap}) < 3 ? 0 : 1;
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
  CHECK(inside_pixels > 20);
  CHECK(unlike <= pixels / 500);  // on edges rounding says which
}
