// SPDX-License-Identifier: Apache-2.0
#include "meshing/surface.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "support/random.h"

namespace pounce::meshing {
namespace {

/// A grid on a sphere with equal vertices at its seam and poles joined.
Surface sphere(std::uint32_t rings, double radius, Vec3d middle) {
  const std::uint32_t across = 2 * rings;
  Surface s;
  constexpr double kPi = 3.14159265358979;
  s.positions.push_back(Vec3f(middle + Vec3d{0, 0, radius}));
  for (std::uint32_t r = 1; r < rings; ++r) {
    for (std::uint32_t c = 0; c < across; ++c) {
      const double a = kPi * r / rings, b = 2 * kPi * c / across;
      s.positions.push_back(
          Vec3f(middle +
                Vec3d{std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)} * radius));
    }
  }
  s.positions.push_back(Vec3f(middle - Vec3d{0, 0, radius}));
  const auto at = [&](std::uint32_t r, std::uint32_t c) {
    return 1 + (r - 1) * across + c % across;
  };
  const auto last = static_cast<std::uint32_t>(s.positions.size() - 1);
  for (std::uint32_t c = 0; c < across; ++c) {
    s.triangles.push_back({0, at(1, c), at(1, c + 1)});
    for (std::uint32_t r = 1; r + 1 < rings; ++r) {
      s.triangles.push_back({at(r, c), at(r + 1, c), at(r + 1, c + 1)});
      s.triangles.push_back({at(r, c), at(r + 1, c + 1), at(r, c + 1)});
    }
    s.triangles.push_back({at(rings - 1, c), last, at(rings - 1, c + 1)});
  }
  return s;
}

void add(Surface& to, const Surface& more) {
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  to.positions.insert(to.positions.end(), more.positions.begin(), more.positions.end());
  for (const Triangle& t : more.triangles)
    to.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

double volume(const Surface& s) {
  double sum = 0;
  for (const Triangle& t : s.triangles)
    sum +=
        dot(Vec3d(s.positions[t[0]]), cross(Vec3d(s.positions[t[1]]), Vec3d(s.positions[t[2]]))) /
        6;
  return sum;
}

TEST_CASE("parts that are small beside the largest go, with their vertices") {
  Surface s = sphere(8, 0.1, {5, 0, 0});
  const Surface large = sphere(12, 1, {0, 0, 0}), half = sphere(8, 0.6, {3, 0, 0});
  add(s, large);
  add(s, half);
  keep_large_parts(s, 0.1);  // areas are as .01, 1 and .36
  CHECK(s.positions.size() == large.positions.size() + half.positions.size());
  CHECK(s.triangles.size() == large.triangles.size() + half.triangles.size());
  Surface nothing;
  keep_large_parts(nothing, 0.1);
  CHECK(nothing.triangles.empty());
}

TEST_CASE("smoothing takes what is uneven and leaves the volume") {
  test::Random random(1);
  const Surface even = sphere(24, 1, {0, 0, 0});
  Surface s = even;
  for (Vec3f& p : s.positions) p = p * random.between(0.97F, 1.03F);
  const auto roughness = [](const Surface& of) {
    double sum = 0;
    for (const Vec3f p : of.positions) sum += std::abs(static_cast<double>(length(p)) - 1);
    return sum / static_cast<double>(of.positions.size());
  };
  const double before = roughness(s);
  smooth(s, 3);
  CHECK(roughness(s) < 0.6 * before);
  CHECK(volume(s) == Approx(volume(even)).epsilon(0.01));
}

TEST_CASE("what lies on a border stays when its surface is smoothed") {
  Surface s;
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x)
      s.positions.push_back(
          {static_cast<float>(x), static_cast<float>(y), x == 1 && y == 1 ? 1.0F : 0});
  }
  for (const std::uint32_t v : {0U, 1U, 3U, 4U}) {
    s.triangles.push_back({v, v + 1, v + 4});
    s.triangles.push_back({v, v + 4, v + 3});
  }
  const Surface before = s;
  smooth(s, 1);
  for (std::size_t v = 0; v < 9; ++v) {
    if (v != 4) CHECK(s.positions[v] == before.positions[v]);
  }
  // Half of the way to its neighbours' mean, 0, then back by .53 of what is left: 1 -> .5 -> .765.
  CHECK(s.positions[4].z == Approx(0.765));
}

TEST_CASE("a surface is simplified to what is asked, and keeps its shape and turn") {
  Surface s = sphere(48, 1, {0, 0, 0});
  const double before = volume(s);
  simplify(s, 1000);
  CHECK(s.triangles.size() <= 1000);
  CHECK(s.triangles.size() > 900);
  CHECK(volume(s) == Approx(before).epsilon(0.02));
  const Surface as_it_is = s;
  simplify(s, 5000);
  CHECK(s.triangles == as_it_is.triangles);
}

TEST_CASE("a surface is simplified as far as it stays within a distance") {
  const Surface dense = sphere(48, 2, {3, 0, 0});
  std::size_t before = dense.triangles.size() + 1;
  for (const double distance : {0.001, 0.01, 0.1}) {
    Surface s = dense;
    simplify_within(s, distance);
    CHECK(s.triangles.size() < before);  // the more it may be off, the fewer there are
    before = s.triangles.size();
    // What lies farthest inside are the middles of triangles.
    double most = 0;
    for (const Triangle& t : s.triangles) {
      const Vec3d middle =
          (Vec3d(s.positions[t[0]]) + Vec3d(s.positions[t[1]]) + Vec3d(s.positions[t[2]])) *
          (1.0 / 3);
      most = std::max(most, 2 - length(middle - Vec3d{3, 0, 0}));
    }
    CHECK(most < 3 * distance + 0.005);  // 0.002 is the dense one off itself
  }
}

TEST_CASE("normals lead outwards and have length one") {
  const Surface s = sphere(16, 2, {1, 2, 3});
  const auto normals = normals_of(s);
  REQUIRE(normals.size() == s.positions.size());
  for (std::size_t v = 0; v < normals.size(); ++v)
    CHECK(dot(normals[v], s.positions[v] - Vec3f{1, 2, 3}) > 2 * 0.99F);
}

}  // namespace
}  // namespace pounce::meshing
