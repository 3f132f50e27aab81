// SPDX-License-Identifier: Apache-2.0
#include "meshing/fit.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "meshing/nearest.h"
#include "support/random.h"

namespace pounce::meshing {
namespace {

/// A sheet over a grid of columns x rows cells, bent by f(x, y), 0..1 both.
template <class F>
Surface sheet(std::uint32_t columns, std::uint32_t rows, const F& f) {
  Surface s;
  for (std::uint32_t r = 0; r <= rows; ++r) {
    for (std::uint32_t c = 0; c <= columns; ++c) {
      const double x = double(c) / columns, y = double(r) / rows;
      s.positions.push_back(Vec3f(Vec3d{x, y, f(x, y)}));
    }
  }
  const auto at = [&](std::uint32_t r, std::uint32_t c) { return r * (columns + 1) + c; };
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t c = 0; c < columns; ++c) {
      s.triangles.push_back({at(r, c), at(r, c + 1), at(r + 1, c + 1)});
      s.triangles.push_back({at(r, c), at(r + 1, c + 1), at(r + 1, c)});
    }
  }
  return s;
}

Vec3d place(const Surface& s, const Foot& foot) {
  Vec3d p{};
  for (std::size_t k = 0; k < 3; ++k)
    p = p + Vec3d(s.positions[s.triangles[foot.triangle][k]]) * foot.shares[k];
  return p;
}

/// The distance to a triangle's point nearest to p, by trying many.
double tried_distance(const Surface& s, const Triangle& t, Vec3d p) {
  constexpr int kSteps = 40;
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const double a = double(i) / kSteps, b = double(j) / kSteps;
      const Vec3d q = Vec3d(s.positions[t[0]]) * a + Vec3d(s.positions[t[1]]) * b +
                      Vec3d(s.positions[t[2]]) * (1 - a - b);
      best = std::min(best, length(q - p));
    }
  }
  return best;
}

/// The root of the mean squared distance of places of the dense one.
double off(const Surface& simplified, const Surface& dense) {
  const Nearest nearest(simplified);
  double sum = 0;
  for (const Vec3f& p : dense.positions) {
    const auto foot = nearest.to(Vec3d(p), {0, 0, 1});
    REQUIRE(foot);
    sum += foot->distance * foot->distance;
  }
  return std::sqrt(sum / static_cast<double>(dense.positions.size()));
}

double hill(double x, double y) { return 0.3 * std::sin(4 * x) * std::cos(3 * y); }

TEST_CASE("the nearest point is the nearest of all triangles that face so") {
  const Surface s = sheet(6, 5, hill);
  const Nearest nearest(s);
  test::Random random(3);
  for (int i = 0; i < 60; ++i) {
    const Vec3d p{random.between(-0.3, 1.3), random.between(-0.3, 1.3), random.between(-1.0, 1.0)};
    double least = std::numeric_limits<double>::infinity();
    for (const Triangle& t : s.triangles) least = std::min(least, tried_distance(s, t, p));
    const auto foot = nearest.to(p, {0, 0, 1});
    REQUIRE(foot);
    // What is tried lies beside the nearest point by up to a fortieth of an edge.
    CHECK(foot->distance <= least + 1e-6);
    CHECK(foot->distance >= least - 0.01);
    CHECK(length(place(s, *foot) - p) == Approx(foot->distance).margin(1e-6));
    CHECK_FALSE(nearest.to(p, {0, 0, -1}));  // all face up
  }
  CHECK_FALSE(Nearest(Surface{}).to({}, {0, 0, 1}));
}

TEST_CASE("what is simplified lies nearer to the dense surface once it is fitted") {
  const Surface dense = sheet(60, 60, hill);
  Surface simplified = dense;
  simplify(simplified, 200);
  const double before = off(simplified, dense);
  Surface fitted = simplified;
  fit(fitted, dense, 4);
  CHECK(fitted.triangles == simplified.triangles);
  CHECK(off(fitted, dense) < 0.8 * before);
  Surface in_steps = dense;
  int polls = 0;
  simplify_fitted(in_steps, 200, [&] { ++polls; });
  CHECK(in_steps.triangles.size() <= 200);
  CHECK(polls >= 5);  // 7200 in halves
  CHECK(off(in_steps, dense) < 0.9 * before);
  // Borders stay: what another mesh joins there still fits.
  for (const Vec3f& p : in_steps.positions) {
    const bool on_border = p.x == 0 || p.x == 1 || p.y == 0 || p.y == 1;
    if (on_border)
      CHECK(std::find(dense.positions.begin(), dense.positions.end(), p) != dense.positions.end());
  }
}

TEST_CASE("nothing turns over, and what is as it was asked for stays") {
  const Surface dense =
      sheet(40, 40, [](double x, double y) { return 0.02 * std::sin(20 * x) * std::sin(17 * y); });
  Surface before = dense;
  simplify(before, 300);
  Surface fitted = before;
  fit(fitted, dense, 4);
  CHECK_FALSE(fitted.positions == before.positions);
  const auto facing = [](const Surface& s, const Triangle& t) {
    const Vec3d a(s.positions[t[0]]), b(s.positions[t[1]]), c(s.positions[t[2]]);
    return cross(b - a, c - a);
  };
  for (const Triangle& t : before.triangles) CHECK(dot(facing(before, t), facing(fitted, t)) > 0);
  Surface same = dense;
  simplify_fitted(same, dense.triangles.size(), [] {});
  CHECK(same.positions == dense.positions);
  Surface nothing;
  fit(nothing, dense, 2);
  CHECK(nothing.triangles.empty());
}

}  // namespace
}  // namespace pounce::meshing
