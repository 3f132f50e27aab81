// SPDX-License-Identifier: Apache-2.0
#include "views/target_depth.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <vector>

#include "support/bytes.h"
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
  const TargetDepths drawn =
      draw_target(mesh, grid, view_kernels(""), view, 0, grid.tiles_across());
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
        const TargetDepths part = draw_target(mesh, grid, view_kernels(""), view, y, rows);
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
  const TargetDepths drawn =
      draw_target(mesh, grid, view_kernels(""), view, 0, grid.tiles_across());
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

TEST_CASE("kernels draw the same depths", "[views]") {
  TargetDepths expected;
  expected.row = 4 * kTileEdge + 2 * kApron;
  expected.tile_rows = 3;
  for (auto* depths : {&expected.samples, &expected.facing})
    depths->resize(std::size_t{expected.row} * expected.rows() + TargetDepths::kBehind, kNoDepth);
  Random random(77);
  std::vector<DepthTriangle> triangles;
  for (int t = 0; t < 4000; ++t) {
    // From less than a pixel to beyond the picture; every third with corners on pixels, so that
    // edges are level, or pass through middles.
    const double size = std::ldexp(1.0, static_cast<int>(random.below(10)) - 2);
    const double x = random.between(-60.0, 320.0), y = random.between(-60.0, 260.0);
    DepthTriangle& triangle = triangles.emplace_back();
    triangle.faces = random.one_in(2);
    for (auto& corner : triangle.corners) {
      corner = {x + random.between(-size, size), y + random.between(-size, size),
                random.between(-1000.0, 70000.0)};
      if (t % 3 == 0) corner = {std::round(corner.x), std::round(corner.y), corner.depth};
    }
  }
  // The plain rule, pixel by pixel; within rounding of a whole step or of an edge either will do.
  TargetDepths low = expected, high = expected;
  for (const DepthTriangle& t : triangles) {
    const auto& [a, b, c] = t.corners;
    const double area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    if (area == 0) continue;
    const auto first = [](double v) {
      return static_cast<int>(std::max(std::ceil(v - 1e-6), 0.0));
    };
    const auto last = [](double v, std::uint32_t end) {
      return static_cast<int>(std::min(std::floor(v + 1e-6), end - 1.0));
    };
    for (int py = first(std::min({a.y, b.y, c.y}));
         py <= last(std::max({a.y, b.y, c.y}), expected.rows()); ++py) {
      for (int px = first(std::min({a.x, b.x, c.x}));
           px <= last(std::max({a.x, b.x, c.x}), expected.row); ++px) {
        const double of_b = ((px - a.x) * (c.y - a.y) - (c.x - a.x) * (py - a.y)) / area,
                     of_c = ((b.x - a.x) * (py - a.y) - (px - a.x) * (b.y - a.y)) / area;
        const double least = std::min({of_b, of_c, 1 - of_b - of_c});
        const double depth =
            a.depth + of_b * (b.depth - a.depth) + of_c * (c.depth - a.depth) + 0.5;
        const auto put = [&](TargetDepths& out, double own) {
          const auto steps = static_cast<std::uint16_t>(std::clamp(own, 0.0, double{kMostDepth}));
          const auto at =
              static_cast<std::size_t>(py) * expected.row + static_cast<std::size_t>(px);
          out.samples[at] = std::min(out.samples[at], steps);
          if (t.faces) out.facing[at] = std::min(out.facing[at], steps);
        };
        const double slack = 1e-6 * (std::abs(b.depth - a.depth) + std::abs(c.depth - a.depth) + 1);
        if (least > -1e-6) put(low, depth - slack);
        if (least > 1e-6) put(high, depth + slack);
      }
    }
  }
  bool is_first = true;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const ViewKernels* kernels = nullptr;
    if (error_kind([&] { kernels = &view_kernels(isa); }) != 0) continue;
    CAPTURE(isa);
    TargetDepths found = low;
    for (auto* depths : {&found.samples, &found.facing})
      std::fill(depths->begin(), depths->end(), kNoDepth);
    kernels->draw_depths(triangles, found);
    if (is_first) expected = found;
    is_first = false;
    CHECK(found.samples == expected.samples);
    CHECK(found.facing == expected.facing);
  }
  std::size_t drawn = 0, unlike = 0;
  for (std::size_t i = 0; i < expected.samples.size(); ++i) {
    drawn += expected.samples[i] != kNoDepth ? 1 : 0;
    unlike += expected.samples[i] < low.samples[i] || expected.samples[i] > high.samples[i] ? 1 : 0;
    unlike += expected.facing[i] < low.facing[i] || expected.facing[i] > high.facing[i] ? 1 : 0;
  }
  CHECK(drawn > expected.samples.size() / 2);
  CHECK(unlike == 0);
}
