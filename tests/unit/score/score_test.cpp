// SPDX-License-Identifier: Apache-2.0
#include "score.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "two_discs.h"

using namespace pounce;
using namespace pounce::score;
using namespace pounce::test;

namespace {

/// Texels around the discs' axis at a height, facing along +z or -z.
Points texels(double z, double facing) {
  Points points;
  points.diagonal = 1;
  for (const double x : {0.0, 0.001, 0.002}) {
    Point p;
    p.position = {x, 0, z};
    p.normal = {0, 0, facing};
    p.edge = 0.001;
    points.points.push_back(p);
  }
  return points;
}

}  // namespace

TEST_CASE("of four sides one sees a texel", "[score]") {
  const Scene scene = two_discs();
  const Truth front = make_truth(scene, texels(1, 1), false);
  REQUIRE(front.four.size() == 3);
  // From a pixel of 1/800 of the diagonal, a little beside the axis.
  const Vec3d expected = (kFront * 0.6 + kBack * 0.32) * (1 / 0.92);
  for (std::uint32_t i = 0; i < 3; ++i) {
    CHECK(front.four[i].point == i);
    CHECK(front.four[i].colour.x == Approx(expected.x).margin(1e-3));
    CHECK(front.four[i].colour.y == Approx(expected.y).margin(1e-3));
    CHECK(front.four[i].colour.z == Approx(expected.z).margin(1e-3));
  }
  CHECK(make_truth(scene, texels(0, -1), false).four.size() == 3);
  // The other disc is in the way, or the texel lies more than 2 % before what is seen.
  CHECK(make_truth(scene, texels(0, 1), false).four.empty());
  CHECK(make_truth(scene, texels(1.03, 1), false).four.empty());
  CHECK(make_truth(scene, texels(1.01, 1), false).four.size() == 3);
}

TEST_CASE("a score is that of all sights and channels", "[score]") {
  const std::vector<Sight> truth{{0, {0.2, 0.4, 0.6}}, {0, {0.2, 0.4, 0.6}}, {1, {1, 1, 1}}};
  // Off by 0.1 in a channel, twice, and by 0.2 in all three; what is too bright is clamped.
  const std::vector<Vec3d> colours{{0.3, 0.4, 0.6}, {0.8, 0.8, 0.8}};
  CHECK(psnr(truth, colours) == Approx(-10 * std::log10((0.01 + 0.01 + 3 * 0.04) / 9)));
  CHECK(share_off(truth, colours) == Approx(1.0 / 3));
  CHECK(share_off(truth, {{0.3, 0.4, 0.6}, {1.4, 1.4, 1.4}}) == 0);
}

TEST_CASE("many views are weighed by their cosines", "[score]") {
  // One opaque ball; from everywhere it shows its one colour to who faces outward.
  SplatPlyBuilder ply;
  ply.rows = {disc(0, 0.999, {0.3, 0.5, 0.7})};
  ply.rows[0]["scale_2"] = std::log(0.2);
  Points points = texels(0, 1);
  points.diagonal = 100;  // so that all of the ball is near
  const Truth truth = make_truth(scene_of(ply), points, false);
  REQUIRE(truth.many.size() == 3);
  CHECK(truth.many[1].colour.x == Approx(0.3).margin(1e-6));
  CHECK(truth.many[1].colour.z == Approx(0.7).margin(1e-6));
}

TEST_CASE("a ranking says how well numbers tell wrong colours", "[score]") {
  Truth truth;
  for (std::uint32_t i = 0; i < 4; ++i) truth.many.push_back({i, {0.5, 0.5, 0.5}});
  // Off by 0.3 and 0.2, right twice; the last one has no number.
  const std::vector<Vec3d> colours{{0.8, 0.5, 0.5}, {0.5, 0.7, 0.5}, {0.5, 0.5, 0.5}, {0, 0, 0}};
  const auto area = [&](double a, double b, double c) {
    return rank(truth, colours, {{a, a, a}, {b, b, b}, {c, c, c}, {}}).area;
  };
  CHECK(area(0.1, 0.2, 0.3) == 1);
  CHECK(area(0.3, 0.2, 0.1) == 0);
  CHECK(area(0.1, 0.3, 0.2) == 0.5);
  CHECK(area(0.2, 0.2, 0.2) == 0.5);
  const Ranking r = rank(truth, colours, {{0.1, 0, 0}, {0.2, 0, 0}, {0.3, 0, 0}, {}});
  CHECK(r.texels == 3);
  CHECK(r.wrong == Approx(2.0 / 3));
  CHECK(r.error == Approx(0.5 / 3));
  CHECK(r.least_error == Approx(0.3));
}

TEST_CASE("a truth may be of what lies far behind alone", "[score]") {
  const Scene scene = two_discs();
  CHECK(make_truth(scene, texels(1.03, 1), false, 0.06).four.size() == 3);
  CHECK(beyond(make_truth(scene, texels(1.03, 1), false, 0.06), 0.02).four.size() == 3);
  CHECK(beyond(make_truth(scene, texels(1.01, 1), false, 0.06), 0.02).four.empty());
}
