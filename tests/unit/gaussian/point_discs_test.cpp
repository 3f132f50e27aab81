// SPDX-License-Identifier: Apache-2.0
#include "gaussian/point_discs.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/directions.h"
#include "support/random.h"

namespace pounce::gaussian {
namespace {

using store::Splat;
using test::Random;

Splat point(float x, float y, float z) {
  Splat s;
  s.mean = {x, y, z};
  s.sigma = {7, 7, 0};
  return s;
}

Vec3f third_axis(const Splat& s) {
  const auto [w, x, y, z] = s.rotation;
  return rotation_columns(w, x, y, z)[2];
}

float cosine(Vec3f a, Vec3f b) { return std::abs(dot(a, b)); }

/// 21 x 21 points of a square lattice with spacing 1, in an order of no meaning.
std::vector<Splat> lattice(Random& random) {
  std::vector<Splat> points;
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 21; ++x)
      points.push_back(point(static_cast<float>(x), static_cast<float>(y), 3));
  }
  for (std::size_t i = points.size() - 1; i > 0; --i)
    std::swap(points[i], points[random.below(i + 1)]);
  return points;
}

const Splat& at(const std::vector<Splat>& points, float x, float y) {
  return *std::find_if(points.begin(), points.end(),
                       [&](const Splat& s) { return s.mean.x == x && s.mean.y == y; });
}

TEST_CASE("points of a lattice become discs in its plane, as large as it is wide") {
  Random random(1);
  std::vector<Splat> points = lattice(random);
  make_discs(points);
  // The twelve nearest: four at 1, four at sqrt(2), four at 2. Twelve on a disc of radius 2 have
  // 4 pi / 12 each: a spacing of 1.0233.
  const Splat& inside = at(points, 10, 10);
  CHECK(inside.sigma.x == Approx(kDiscOverSpacing * 1.02333).epsilon(1e-4));
  CHECK(inside.sigma.y == inside.sigma.x);
  CHECK(inside.sigma.z == 0);
  for (const Splat& s : points) CHECK(cosine(third_axis(s), {0, 0, 1}) > 0.9999F);
  // On a border: three at 1, two at sqrt(2), three at 2, four of eight at sqrt(5), by number. Their
  // mean lies inside, so that they are taken for about half of a disc.
  const Splat& border = at(points, 0, 10);
  CHECK(border.sigma.x > 0.75F * inside.sigma.x);
  CHECK(border.sigma.x < 1.1F * inside.sigma.x);
}

TEST_CASE("a point's own normal is believed") {
  Random random(2);
  std::vector<Splat> points = lattice(random);
  for (Splat& s : points) s.normal = {0.6F, 0, 0.8F};
  make_discs(points);
  for (const Splat& s : points) {
    CHECK(cosine(third_axis(s), {0.6F, 0, 0.8F}) > 0.9999F);
    CHECK(cosine(s.normal, {0.6F, 0, 0.8F}) > 0.9999F);
  }
}

TEST_CASE("neighbours are those that a search through all finds, in whatever order points come") {
  Random random(3);
  for (const std::size_t count : {3u, 12u, 13u, 14u, 200u, 4096u}) {
    std::vector<Splat> points;
    for (std::size_t i = 0; i < count; ++i) {
      const float x = random.between(-1.0F, 1.0F), y = random.between(-1.0F, 1.0F);
      points.push_back(point(x, y, 0.3F * x - 0.2F * y + random.between(-0.01F, 0.01F)));
      // Some twice, so that distances are equal.
      if (random.one_in(5)) points.back().mean = points[random.below(points.size())].mean;
    }
    std::vector<Splat> discs = points;
    make_discs(discs);
    std::vector<float> expected;
    for (std::size_t i = 0; i < count; ++i) {
      std::vector<std::pair<float, std::size_t>> others;
      for (std::size_t j = 0; j < count; ++j) {
        const Vec3f d = points[j].mean - points[i].mean;
        if (j != i) others.emplace_back(dot(d, d), j);
      }
      std::sort(others.begin(), others.end());
      others.resize(std::min<std::size_t>(others.size(), 12));
      Vec3f mean{};
      for (const auto& [squared, j] : others) mean = mean + (points[j].mean - points[i].mean);
      const auto n = static_cast<float>(others.size());
      const float radius = std::sqrt(others.back().first);
      const float aside = std::sqrt(dot(mean, mean)) / (n * radius);
      const float part = std::clamp(1 - 0.5F * (aside - 0.2F) / (0.42441318F - 0.2F), 0.25F, 1.0F);
      expected.push_back(radius > 0 ? radius * std::sqrt(3.14159265F * part / n) : 0);
    }
    std::vector<float> ordered = expected;
    std::nth_element(ordered.begin(), ordered.begin() + static_cast<std::ptrdiff_t>(count / 2),
                     ordered.end());
    const float usual = ordered[count / 2];
    CAPTURE(count);
    for (std::size_t i = 0; i < count; ++i) {
      const float own = expected[i] > 0 ? std::min(expected[i], 4 * usual) : usual;
      CHECK(discs[i].sigma.x == Approx(kDiscOverSpacing * own).epsilon(1e-3));
    }
    if (count >= 200) {
      const Vec3f normal = Vec3f(unit_vector(Vec3d{-0.3, 0.2, 1}));
      std::size_t tilted = 0;
      for (const Splat& s : discs) tilted += cosine(third_axis(s), normal) < 0.9F ? 1 : 0;
      CHECK(tilted < count / 20);
    }
  }
}

TEST_CASE("a stray point is no larger than four usual ones") {
  Random random(4);
  std::vector<Splat> points = lattice(random);
  points.push_back(point(500, 500, 500));
  make_discs(points);
  std::vector<Splat> others(points.begin(), points.end() - 1);
  std::sort(others.begin(), others.end(),
            [](const Splat& a, const Splat& b) { return a.sigma.x < b.sigma.x; });
  CHECK(points.back().sigma.x == Approx(4 * others[others.size() / 2].sigma.x).epsilon(1e-3));
}

TEST_CASE("where points say nothing of their spacing they stay as they are") {
  std::vector<Splat> two{point(0, 0, 0), point(1, 0, 0)}, equal(40, point(1, 2, 3));
  make_discs(two);
  make_discs(equal);
  for (const auto* points : {&two, &equal}) {
    for (const Splat& s : *points) CHECK(s.sigma == Vec3f{7, 7, 0});
  }
  // One place twenty times, among others: as large as these.
  Random random(5);
  std::vector<Splat> points = lattice(random);
  for (int i = 0; i < 20; ++i) points.push_back(point(10, 10, 3));
  make_discs(points);
  CHECK(points.back().sigma.x == Approx(kDiscOverSpacing * 1.02333).epsilon(0.02));
}

}  // namespace
}  // namespace pounce::gaussian
