// SPDX-License-Identifier: Apache-2.0
#include "unwrap/unwrap.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <set>
#include <vector>

namespace pounce::unwrap {
namespace {

struct Mesh {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
};

constexpr double kPi = 3.14159265358979;

/// rows x columns quads of f(row, column), which may close on itself.
template <class F>
Mesh grid(std::uint32_t rows, std::uint32_t columns, bool closed_rows, bool closed_columns,
          const F& f) {
  Mesh m;
  const std::uint32_t high = closed_rows ? rows : rows + 1,
                      wide = closed_columns ? columns : columns + 1;
  for (std::uint32_t r = 0; r < high; ++r) {
    for (std::uint32_t c = 0; c < wide; ++c)
      m.positions.push_back(Vec3f(f(double(r) / rows, double(c) / columns)));
  }
  const auto at = [&](std::uint32_t r, std::uint32_t c) { return r % high * wide + c % wide; };
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t c = 0; c < columns; ++c) {
      m.triangles.push_back({at(r, c), at(r + 1, c), at(r + 1, c + 1)});
      m.triangles.push_back({at(r, c), at(r + 1, c + 1), at(r, c + 1)});
    }
  }
  return m;
}

Mesh cube() {
  Mesh m;
  for (int i = 0; i < 8; ++i)
    m.positions.push_back(
        {static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1), static_cast<float>(i >> 2)});
  const std::uint32_t quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                     {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : quads) {
    m.triangles.push_back({q[0], q[1], q[2]});
    m.triangles.push_back({q[0], q[2], q[3]});
  }
  return m;
}

double cross2(Vec2f a, Vec2f b, Vec2f c) {
  return (double(b.x) - double(a.x)) * (double(c.y) - double(a.y)) -
         (double(b.y) - double(a.y)) * (double(c.x) - double(a.x));
}

/// By sides, a test of its own: do the insides of two triangles have a point in common?
bool overlap(const Vec2f* a, const Vec2f* b) {
  const auto apart = [](const Vec2f* p, const Vec2f* q) {
    const double turn = cross2(p[0], p[1], p[2]) < 0 ? -1 : 1;
    for (int k = 0; k < 3; ++k) {
      bool all_beyond = true;
      for (int j = 0; j < 3; ++j)
        all_beyond = all_beyond && turn * cross2(p[k], p[(k + 1) % 3], q[j]) <= 1e-9;
      if (all_beyond) return true;
    }
    return false;
  };
  return !apart(a, b) && !apart(b, a);
}

/// Every pair of triangles; texels between charts; that texels are as large everywhere.
void check(const Mesh& mesh, const Options& options, const Unwrapped& flat) {
  REQUIRE(flat.triangles.size() == mesh.triangles.size());
  REQUIRE(flat.uvs.size() == flat.vertex.size());
  double in_space = 0, on_image = 0;
  std::vector<std::array<Vec2f, 3>> own(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(flat.vertex[flat.triangles[t][k]] == mesh.triangles[t][k]);
      own[t][k] = flat.uvs[flat.triangles[t][k]];
      CHECK((own[t][k].x >= 0 && own[t][k].x <= 1 && own[t][k].y >= 0 && own[t][k].y <= 1));
    }
    const Vec3d a(mesh.positions[mesh.triangles[t][0]]), b(mesh.positions[mesh.triangles[t][1]]),
        c(mesh.positions[mesh.triangles[t][2]]);
    in_space += length(cross(b - a, c - a)) / 2;
    // v downwards: what is counter-clockwise from outside is clockwise in numbers, and not turned
    // over.
    CHECK(cross2(own[t][0], own[t][1], own[t][2]) <= 1e-12);
    on_image += std::abs(cross2(own[t][0], own[t][1], own[t][2])) / 2;
  }
  CHECK(flat.fill == Approx(on_image / options.tiles).epsilon(1e-3));
  std::size_t overlaps = 0, close = 0;
  const float gutter = static_cast<float>(options.gutter) / static_cast<float>(options.size);
  for (std::size_t s = 0; s < own.size(); ++s) {
    for (std::size_t t = s + 1; t < own.size(); ++t) {
      if (flat.tiles[flat.charts[s]] != flat.tiles[flat.charts[t]]) continue;
      overlaps += overlap(own[s].data(), own[t].data()) ? 1 : 0;
      if (flat.charts[s] == flat.charts[t]) continue;
      for (const Vec2f p : own[s]) {
        for (const Vec2f q : own[t])
          close += std::hypot(p.x - q.x, p.y - q.y) < gutter * 0.999F ? 1 : 0;
      }
    }
  }
  CHECK(overlaps == 0);
  CHECK(close == 0);
  // The length of an edge on the image, of what it is in space: within the stretch of 1.5 and more
  // of it for most, since charts as wholes have their areas.
  const double scale = std::sqrt(on_image / in_space);
  std::vector<double> stretches;
  for (std::size_t t = 0; t < own.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3d edge(mesh.positions[mesh.triangles[t][(k + 1) % 3]] -
                       mesh.positions[mesh.triangles[t][k]]);
      const double on =
          std::hypot(own[t][(k + 1) % 3].x - own[t][k].x, own[t][(k + 1) % 3].y - own[t][k].y);
      if (length(edge) > 0 && on > 0)
        stretches.push_back(std::max(on / (length(edge) * scale), length(edge) * scale / on));
    }
  }
  std::sort(stretches.begin(), stretches.end());
  CHECK(stretches[stretches.size() * 95 / 100] <= 1.5);
}

TEST_CASE("a cube is unfolded, and nothing of it stretched") {
  const Mesh mesh = cube();
  const Options options{512, 4};
  const Unwrapped flat = unwrap(mesh.positions, mesh.triangles, options);
  check(mesh, options, flat);
  CHECK(flat.chart_count <= 6);
  CHECK(flat.vertex.size() <= 24);
  CHECK(flat.fill > 0.6);
  // A square's edge on the image is the same everywhere, and its diagonal as much longer.
  const double edge = std::sqrt(flat.fill / 6);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Triangle &of = mesh.triangles[t], &on = flat.triangles[t];
      const double in_space =
          length(Vec3d(mesh.positions[of[k]]) - Vec3d(mesh.positions[of[(k + 1) % 3]]));
      const Vec2f p = flat.uvs[on[k]], q = flat.uvs[on[(k + 1) % 3]];
      CHECK(std::hypot(p.x - q.x, p.y - q.y) == Approx(edge * in_space).epsilon(1e-3));
    }
  }
}

TEST_CASE("a rough surface does not fall to pieces") {
  // As captures are: every point is off by up to two thirds of an edge, so that many triangles face
  // anywhere.
  std::uint32_t state = 1;
  const auto noise = [&state] {
    state = state * 1664525U + 1013904223U;
    return (state >> 8) / double(1 << 24) - 0.5;
  };
  auto ball = grid(40, 80, false, true, [&](double r, double c) {
    const double a = kPi * (0.02 + 0.96 * r), b = 2 * kPi * c;
    const double far = 1 + 0.1 * noise();
    return Vec3d{far * std::sin(a) * std::cos(b), far * std::sin(a) * std::sin(b),
                 far * std::cos(a)};
  });
  const Options options{1024, 4};
  const Unwrapped flat = unwrap(ball.positions, ball.triangles, options);
  CAPTURE(flat.chart_count, flat.fill);
  CHECK(flat.chart_count < 120);  // 305 by the triangles' own normals
  CHECK(flat.fill > 0.6);
  check(ball, options, flat);
}

TEST_CASE("charts fill several tiles in one scale, and are cut where they would not fit into one") {
  const Mesh sheet = grid(24, 24, false, false, [](double r, double c) {
    return Vec3d{c, 1 - r, 0.02 * std::sin(3 * c)};
  });
  const Options one{256, 4}, five{256, 4, 5};
  CHECK(unwrap(sheet.positions, sheet.triangles, one).chart_count == 1);
  const Unwrapped flat = unwrap(sheet.positions, sheet.triangles, five);
  check(sheet, five, flat);
  CAPTURE(flat.chart_count);
  CHECK(flat.fill > 0.6);  // in one piece it would fill a fifth
  REQUIRE(flat.tiles.size() == flat.chart_count);
  for (std::uint32_t tile = 0; tile < 5; ++tile)
    CHECK(std::count(flat.tiles.begin(), flat.tiles.end(), tile) > 0);
  CHECK(*std::max_element(flat.tiles.begin(), flat.tiles.end()) == 4);
}

TEST_CASE("what packing may keep does not decide where charts go") {
  const Mesh mesh = cube();
  Options options{512, 4, 2};
  const Unwrapped with = unwrap(mesh.positions, mesh.triangles, options);
  options.masks_bytes = 0;
  const Unwrapped without = unwrap(mesh.positions, mesh.triangles, options);
  CHECK(with.tiles == without.tiles);
  CHECK(with.uvs == without.uvs);
}

TEST_CASE("two sheets that touch, and a flap that is folded onto itself") {
  // A sheet with both sides, which share all their points: inner edges have four triangles, and at
  // two of the corners a triangle and its back share two edges.
  Mesh mesh = grid(12, 12, false, false, [](double r, double c) {
    return Vec3d{c, 1 - r, 0.1 * std::sin(3 * c)};
  });
  const std::size_t front = mesh.triangles.size();
  for (std::size_t t = 0; t < front; ++t) {
    const Triangle own = mesh.triangles[t];
    mesh.triangles.push_back({own[0], own[2], own[1]});
  }
  const Options options{512, 2};
  const Unwrapped flat = unwrap(mesh.positions, mesh.triangles, options);
  CAPTURE(flat.chart_count);
  check(mesh, options, flat);
  CHECK(flat.chart_count <= 12);
}

TEST_CASE("round and twisted shapes are cut so that nothing overlaps") {
  const auto torus = grid(24, 48, true, true, [](double r, double c) {
    const double a = 2 * kPi * r, b = 2 * kPi * c;
    return Vec3d{(2 + 0.7 * std::cos(a)) * std::cos(b), (2 + 0.7 * std::cos(a)) * std::sin(b),
                 0.7 * std::sin(a)};
  });
  // Faces up everywhere, three times round: one chart by its normals, and above itself.
  const auto stairs = grid(2, 96, false, false, [](double r, double c) {
    const double a = 6 * kPi * c;
    return Vec3d{(1 + r) * std::cos(a), (1 + r) * std::sin(a), 0.5 * a / kPi};
  });
  const auto wave = grid(40, 40, false, false, [](double r, double c) {
    return Vec3d{c, 1 - r, 0.2 * std::sin(9 * r) * std::cos(7 * c)};
  });
  for (const Mesh* mesh : {&torus, &stairs, &wave}) {
    const Options options{1024, 4};
    const Unwrapped flat = unwrap(mesh->positions, mesh->triangles, options);
    CAPTURE(mesh->triangles.size(), flat.chart_count);
    check(*mesh, options, flat);
    CHECK(flat.fill > 0.35);
  }
  const Unwrapped flat = unwrap(stairs.positions, stairs.triangles, {1024, 4});
  CHECK(flat.chart_count >= 3);
}

TEST_CASE("triangles without area, edges of three triangles and no triangles at all") {
  Mesh mesh = cube();
  mesh.triangles.push_back({0, 1, 1});
  mesh.triangles.push_back({0, 1, 6});  // a third one on an edge
  const Unwrapped flat = unwrap(mesh.positions, mesh.triangles, {256, 2});
  CHECK(flat.triangles.size() == mesh.triangles.size());
  for (const Vec2f uv : flat.uvs) CHECK((uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1));
  CHECK(unwrap({}, {}, {256, 2}).triangles.empty());
  const std::vector<Vec3f> point(3);
  const std::vector<Triangle> nothing{{0, 1, 2}};
  CHECK(unwrap(point, nothing, {256, 2}).triangles.size() == 1);
}

TEST_CASE("slivers and fans of long triangles cut nothing apart that is flat") {
  // A plane, tilted, with a triangle without area on each diagonal.
  Mesh plane = grid(40, 40, false, false, [](double r, double c) {
    return Vec3d{c, 0.3 * c - r, 0.7 * r + 0.1 * c};
  });
  const std::size_t quads = plane.triangles.size();
  for (std::size_t t = 0; t < quads; t += 2) {
    const Triangle own = plane.triangles[t + 1];
    const auto middle = static_cast<std::uint32_t>(plane.positions.size());
    plane.positions.push_back((plane.positions[own[0]] + plane.positions[own[1]]) * 0.5F);
    plane.triangles[t + 1] = {own[0], middle, own[2]};
    plane.triangles.push_back({middle, own[1], own[2]});
    plane.triangles.push_back({own[0], own[1], middle});
  }
  CHECK(unwrap(plane.positions, plane.triangles, {512, 2}).chart_count < 50);
  Mesh fan;
  fan.positions.push_back({0, 0, 0});
  for (int i = 0; i <= 1000; ++i) {
    const double a = 1.5 * i / 1000;
    fan.positions.push_back(Vec3f(Vec3d{std::cos(a), std::sin(a), 0}));
  }
  for (std::uint32_t i = 1; i <= 1000; ++i) fan.triangles.push_back({0, i, i + 1});
  CHECK(unwrap(fan.positions, fan.triangles, {512, 2}).chart_count == 1);
}

TEST_CASE("small triangles that lie over a large one are found") {
  // A helix, twice round and small, that hangs at a corner of a large triangle: all of it is above
  // the large one, seen from above.
  Mesh mesh;
  mesh.positions = {{0.002F, 0, 0}, {1, -0.5F, 0}, {1, 0.5F, 0}};
  mesh.triangles = {{0, 1, 2}};
  std::uint32_t inner = 0, outer = 0;
  for (int i = 0; i <= 32; ++i) {
    const double a = 4 * kPi * i / 32 + kPi / 2;
    const Vec3d way{std::cos(a), std::sin(a), 0}, middle{0.1, 0, 0.0002 * i};
    mesh.positions.push_back(Vec3f(middle + way * 0.02));
    mesh.positions.push_back(Vec3f(middle + way * 0.04));
    const auto next = static_cast<std::uint32_t>(mesh.positions.size() - 2);
    if (i > 0) {
      mesh.triangles.push_back({inner, outer, next + 1});
      mesh.triangles.push_back({inner, next + 1, next});
    } else {
      mesh.triangles.push_back({0, 2, next});
      mesh.triangles.push_back({2, next + 1, next});
    }
    inner = next, outer = next + 1;
  }
  const Options options{2048, 2};
  const Unwrapped flat = unwrap(mesh.positions, mesh.triangles, options);
  CAPTURE(flat.chart_count);
  check(mesh, options, flat);
}

TEST_CASE("a needle has its place, and a fan of thousands is looked at in time") {
  const std::vector<Vec3f> points{{0, 0, 0}, {1e6F, 0, 0}, {1e6F, 1e-3F, 0}, {0, 1e-3F, 0}};
  const std::vector<Triangle> needle{{0, 1, 2}, {0, 2, 3}};
  CHECK(unwrap(points, needle, {4096, 0}).fits);
  Mesh fan;
  fan.positions.push_back({0, 0, 0});
  constexpr std::uint32_t kMany = 3000;
  for (std::uint32_t i = 0; i <= kMany; ++i) {
    const double a = 5.5 * i / kMany;
    fan.positions.push_back(Vec3f(Vec3d{std::cos(a), std::sin(a), 0}));
  }
  for (std::uint32_t i = 1; i <= kMany; ++i) fan.triangles.push_back({0, i, i + 1});
  CHECK(unwrap(fan.positions, fan.triangles, {512, 2}).chart_count <= 20);
}

TEST_CASE("charts that have no room beside their gutters are said to have none") {
  const Mesh mesh = cube();
  CHECK_FALSE(unwrap(mesh.positions, mesh.triangles, {64, 60}).fits);
  CHECK(unwrap(mesh.positions, mesh.triangles, {64, 8}).fits);
  const Unwrapped odd = unwrap(mesh.positions, mesh.triangles, {100, 3});  // no multiple of 64
  check(mesh, {100, 3}, odd);
}

TEST_CASE("the same mesh has the same UVs") {
  const auto ball = grid(24, 48, false, true, [](double r, double c) {
    const double a = kPi * (0.02 + 0.96 * r), b = 2 * kPi * c;
    return Vec3d{std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)};
  });
  const Unwrapped one = unwrap(ball.positions, ball.triangles, {512, 4});
  const Unwrapped other = unwrap(ball.positions, ball.triangles, {512, 4});
  CHECK(one.uvs == other.uvs);
  check(ball, {512, 4}, one);
  CHECK(one.chart_count < 40);
}

}  // namespace
}  // namespace pounce::unwrap
