// SPDX-License-Identifier: Apache-2.0
#include "render.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "two_discs.h"

using namespace pounce;
using namespace pounce::score;
using namespace pounce::test;

namespace {

Point point_at(Vec3d position) {
  Point p;
  p.position = position;
  p.normal = {0, 0, 1};
  return p;
}

void check_equal(Vec3d a, Vec3d b) {
  CHECK(a.x == Approx(b.x).margin(1e-6));
  CHECK(a.y == Approx(b.y).margin(1e-6));
  CHECK(a.z == Approx(b.z).margin(1e-6));
}

}  // namespace

TEST_CASE("a disc before another hides it by its alpha", "[score]") {
  const Scene scene = two_discs();
  const std::vector<Point> points{point_at({0, 0, -3})};
  const Pixel from_above = render(scene, points, {0, 0, -1}, 1e-6, false)[0];
  // 0.6 of the front, then 0.8 of what it lets through.
  CHECK(from_above.opacity == Approx(0.92));
  check_equal(from_above.colour * 0.92, kFront * 0.6 + kBack * 0.32);
  CHECK(from_above.median_depth == Approx(-1));
  const Pixel from_below = render(scene, points, {0, 0, 1}, 1e-6, false)[0];
  CHECK(from_below.opacity == Approx(0.92));
  check_equal(from_below.colour * 0.92, kBack * 0.8 + kFront * 0.12);
  CHECK(from_below.median_depth == Approx(0).margin(1e-9));
}

TEST_CASE("a pixel widens what it shows", "[score]") {
  const Scene scene = two_discs();
  // Variances of 0.2^2 and of 0.3 pixel^2 = 0.01; there exp(-d^2 / 0.1) is a half.
  const double pixel = std::sqrt(1.0 / 30), d = std::sqrt(0.1 * std::log(2.0));
  const std::vector<Point> points{point_at({d, 0, 0}), point_at({0, -d, 0}), point_at({0.7, 0, 0})};
  const std::vector<Pixel> seen = render(scene, points, {0, 0, -1}, pixel, false);
  for (const std::size_t i : {0, 1}) {
    CHECK(seen[i].opacity == Approx(1 - 0.7 * 0.6));
    check_equal(seen[i].colour * 0.58, kFront * 0.3 + kBack * 0.28);
    CHECK(seen[i].median_depth == Approx(0).margin(1e-6));  // 0.7, then 0.42 of the light
  }
  CHECK(seen[2].opacity == 0);  // beyond 3 standard deviations: 0.671
  CHECK(std::isinf(seen[2].median_depth));
}

TEST_CASE("an antialiased scene keeps what a pixel spreads", "[score]") {
  Scene scene = two_discs();
  scene.antialiased = true;
  const double pixel = std::sqrt(1.0 / 30);
  const std::vector<Point> points{point_at({0, 0, 0})};
  // Each variance of 0.04 becomes 0.05: det / det' = 0.64, of which the root counts.
  CHECK(render(scene, points, {0, 0, -1}, pixel, false)[0].opacity ==
        Approx(1 - (1 - 0.6 * 0.8) * (1 - 0.8 * 0.8)));
}

TEST_CASE("a harmonic shows itself from its side", "[score]") {
  SplatPlyBuilder ply;
  ply.columns = SplatPlyBuilder::usual_columns(9);
  ply.rows = {disc(0, 0.8, {0.5, 0.5, 0.5})};
  ply.rows[0]["f_rest_1"] = 0.5;  // red along z
  const Scene scene = scene_of(ply);
  const std::vector<Point> points{point_at({0, 0, 0})};
  const auto red = [&](double z, bool harmonics) {
    return render(scene, points, {0, 0, z}, 1e-6, harmonics)[0].colour.x;
  };
  CHECK(red(1, true) == Approx(0.5 + 0.4886025119029199 * 0.5));
  CHECK(red(-1, true) == Approx(0.5 - 0.4886025119029199 * 0.5));
  CHECK(red(1, false) == Approx(0.5));
}

TEST_CASE("compositing along a normal begins where it is told", "[score]") {
  const Scene scene = two_discs();
  const std::vector<Point> points{point_at({0, 0, 0.5}), point_at({5, 0, 0.5})};
  const auto from = [&](double above) { return hits(scene, points, above, 1); };
  const auto both = from(0.75), back = from(0.25);
  REQUIRE(both[0].size() == 2);
  REQUIRE(back[0].size() == 1);
  CHECK(back[0][0].t == Approx(-0.5));
  check_equal(composite(scene, both[0]) * 0.92, kFront * 0.6 + kBack * 0.32);
  check_equal(composite(scene, back[0]), kBack);
  CHECK(both[1].empty());
  CHECK(composite(scene, both[1]) == Vec3d{0.5, 0.5, 0.5});
}
