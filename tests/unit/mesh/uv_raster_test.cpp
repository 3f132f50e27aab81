// SPDX-License-Identifier: Apache-2.0
#include "mesh/uv_raster.h"

#include <array>
#include <catch2/catch.hpp>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "support/random.h"

using pounce::Vec2d;
using pounce::mesh::raster_triangle;
using pounce::mesh::TexelWindow;
using pounce::mesh::triangle_touches;
using pounce::test::Random;

namespace {

// The reference counts in 1/65536 texel, where every product is exact in 64 bits.
constexpr std::int64_t kUnit = 65536;

struct Point {
  std::int64_t x = 0, y = 0;
};
using Triangle = std::array<Point, 3>;
using Texel = std::pair<std::int64_t, std::int64_t>;  // y, x

std::int64_t doubled_area(Point a, Point b, Point c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// The rule itself: inside all three edges; a centre on an edge belongs to top and left edges.
bool covers(const Triangle& t, std::int64_t x, std::int64_t y) {
  const std::int64_t area = doubled_area(t[0], t[1], t[2]);
  if (area == 0) return false;
  const Point p{x * kUnit, y * kUnit};
  for (std::size_t i = 0; i < 3; ++i) {
    Point from = t[i], to = t[(i + 1) % 3];
    if (area < 0) std::swap(from, to);
    const std::int64_t e = doubled_area(from, to, p);
    const bool top_left = to.y < from.y || (to.y == from.y && to.x > from.x);
    if (e < 0 || (e == 0 && !top_left)) return false;
  }
  return true;
}

std::array<Vec2d, 3> as_texels(const Triangle& t, double offset = 0) {
  std::array<Vec2d, 3> out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = {static_cast<double>(t[i].x) / kUnit + offset,
              static_cast<double>(t[i].y) / kUnit + offset};
  }
  return out;
}

std::map<Texel, int> rastered(const std::array<Vec2d, 3>& corners, const TexelWindow& window) {
  std::map<Texel, int> texels;
  raster_triangle(corners, window, [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
    for (std::int64_t x = begin; x < end; ++x) ++texels[{y, x}];
  });
  return texels;
}

/// Splits a square again and again at random points: needles, huge fans, points on texel centres.
std::vector<Triangle> random_mesh(Random& random, Point low, Point high, int splits) {
  std::vector<Triangle> mesh{{low, {high.x, low.y}, high}, {low, high, {low.x, high.y}}};
  for (int i = 0; i < splits; ++i) {
    const Triangle t = mesh[random.below(mesh.size())];
    const double a = random.unit(), b = random.unit() * (1 - a), c = 1 - a - b;
    const auto mix = [&](std::int64_t p, std::int64_t q, std::int64_t r) {
      return static_cast<std::int64_t>(a * static_cast<double>(p) + b * static_cast<double>(q) +
                                       c * static_cast<double>(r));
    };
    Point p{mix(t[0].x, t[1].x, t[2].x), mix(t[0].y, t[1].y, t[2].y)};
    if (random.one_in(3)) p.x = p.x / kUnit * kUnit;
    if (random.one_in(3)) p.y = p.y / kUnit * kUnit;
    if (doubled_area(t[0], t[1], p) <= 0 || doubled_area(t[1], t[2], p) <= 0 ||
        doubled_area(t[2], t[0], p) <= 0) {
      continue;
    }
    for (Triangle& other : mesh) {
      if (other[0].x == t[0].x && other[0].y == t[0].y && other[1].x == t[1].x &&
          other[1].y == t[1].y && other[2].x == t[2].x && other[2].y == t[2].y) {
        other = {t[0], t[1], p};
        break;
      }
    }
    mesh.push_back({t[1], t[2], p});
    mesh.push_back({t[2], t[0], p});
  }
  for (Triangle& t : mesh) {  // any corner first, any winding
    std::rotate(t.begin(), t.begin() + static_cast<std::ptrdiff_t>(random.below(3)), t.end());
    if (random.one_in(2)) std::swap(t[1], t[2]);
  }
  return mesh;
}

constexpr TexelWindow kEverywhere{-(1LL << 40), -(1LL << 40), 1LL << 40, 1LL << 40};

}  // namespace

TEST_CASE("a triangulated square gives every texel centre to exactly one triangle") {
  const double offset = GENERATE(0.0, -100.0, 1073741824.0);
  Random random(7);
  for (int round = 0; round < 20; ++round) {
    // -1/2 .. 40 1/2: the centres 0..40 and no other.
    const auto mesh =
        random_mesh(random, {-kUnit / 2, -kUnit / 2}, {81 * kUnit / 2, 81 * kUnit / 2}, 120);
    REQUIRE(mesh.size() > 100);
    std::map<Texel, int> covered;
    for (const Triangle& t : mesh) {
      for (const auto& [texel, times] : rastered(as_texels(t, offset), kEverywhere)) {
        covered[texel] += times;
      }
    }
    CHECK(covered.size() == 41 * 41);
    const auto shift = static_cast<std::int64_t>(offset);
    for (std::int64_t y = 0; y <= 40; ++y) {
      for (std::int64_t x = 0; x <= 40; ++x) {
        if (covered[{y + shift, x + shift}] != 1)
          FAIL("texel " << x << "," << y << " is covered " << covered[{y + shift, x + shift}]
                        << " times in round " << round);
      }
    }
  }
}

TEST_CASE("centres on the border of a square belong to its top and left") {
  const Triangle upper{Point{0, 0}, {3 * kUnit, 0}, {3 * kUnit, 2 * kUnit}};
  const Triangle lower{Point{0, 0}, {3 * kUnit, 2 * kUnit}, {0, 2 * kUnit}};
  std::map<Texel, int> covered = rastered(as_texels(upper), kEverywhere);
  for (const auto& [texel, times] : rastered(as_texels(lower), kEverywhere))
    covered[texel] += times;
  const std::map<Texel, int> expected{{{0, 0}, 1}, {{0, 1}, 1}, {{0, 2}, 1},
                                      {{1, 0}, 1}, {{1, 1}, 1}, {{1, 2}, 1}};
  CHECK(covered == expected);
}

TEST_CASE("spans are the brute-force edge test cut at the window") {
  Random random(11);
  std::size_t covered_texels = 0, touched_without_texel = 0;
  for (int round = 0; round < 4000; ++round) {
    const std::int64_t step = std::int64_t{1} << random.whole(8, 16);  // often on centres
    Triangle t;
    for (Point& p : t) {
      p = {random.whole(-30 * kUnit / step, 30 * kUnit / step) * step,
           random.whole(-30 * kUnit / step, 30 * kUnit / step) * step};
    }
    if (random.one_in(4)) {  // a needle
      t[2] = {t[1].x + random.whole(-9, 9), t[1].y + random.whole(-9, 9)};
    }
    TexelWindow window{random.whole(-32, 30), random.whole(-32, 30), 0, 0};
    window.x1 = window.x0 + random.whole(1, 40);
    window.y1 = window.y0 + random.whole(1, 40);

    std::map<Texel, int> expected;
    for (std::int64_t y = window.y0; y < window.y1; ++y) {
      for (std::int64_t x = window.x0; x < window.x1; ++x) {
        if (covers(t, x, y)) expected[{y, x}] = 1;
      }
    }
    std::int64_t last_row = -1000;
    bool ordered = true;
    raster_triangle(as_texels(t), window,
                    [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
                      ordered = ordered && y > last_row && begin < end;
                      last_row = y;
                    });
    if (!ordered || rastered(as_texels(t), window) != expected) FAIL("round " << round);
    const bool touches = triangle_touches(as_texels(t), window, 0);
    if (!expected.empty() && !touches) FAIL("touches() misses the window in round " << round);
    if (touches && !triangle_touches(as_texels(t), window, 1)) FAIL("margin, round " << round);
    covered_texels += expected.size();
    touched_without_texel += expected.empty() && touches;
  }
  CHECK(covered_texels > 50000);
  CHECK(touched_without_texel < 1500);  // it also says no, or it would be of no use
}

TEST_CASE("a triangle without area covers nothing") {
  const std::vector<std::array<Vec2d, 3>> flat{
      {Vec2d{1, 1}, Vec2d{1, 1}, Vec2d{1, 1}},       // a point on a centre
      {Vec2d{0, 0}, Vec2d{5, 5}, Vec2d{9, 9}},       // a diagonal through centres
      {Vec2d{0, 2}, Vec2d{8, 2}, Vec2d{3, 2}},       // a row of centres
      {Vec2d{4, 0}, Vec2d{4, 8}, Vec2d{4, 8}},       // a column of centres
      {Vec2d{0.5, 0}, Vec2d{0.5, 0}, Vec2d{3, 7}}};  // an edge walked twice
  for (const auto& corners : flat) CHECK(rastered(corners, kEverywhere).empty());
}

TEST_CASE("a window far away is not touched, one in a needle's box but beside it neither") {
  const std::array<Vec2d, 3> needle{Vec2d{0, 0}, Vec2d{1000, 1000}, Vec2d{1000, 1001}};
  CHECK(triangle_touches(needle, {448, 448, 512, 512}, 1));
  CHECK_FALSE(triangle_touches(needle, {0, 448, 64, 512}, 1));
  CHECK_FALSE(triangle_touches(needle, {448, 0, 512, 64}, 1));
  CHECK_FALSE(triangle_touches(needle, {1024, 0, 1088, 64}, 1));
  CHECK(triangle_touches(needle, {1001, 1001, 1064, 1064}, 1));
  CHECK_FALSE(triangle_touches(needle, {1002, 1002, 1064, 1064}, 1));
}
