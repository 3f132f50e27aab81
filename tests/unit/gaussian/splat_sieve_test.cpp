// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "gaussian/splat_set.h"
#include "support/splat_scenes.h"

using namespace pounce;
using namespace pounce::gaussian;
using namespace pounce::test;

namespace {

/// How far apart the box of the Gaussian's ellipsoid and this box are along the axis where they are
/// farthest; negative: they overlap by so much along each.
double gap(const ReferenceSplat& splat, const Box3f& box) {
  const auto c = covariance(splat);
  const double mean[3] = {splat.mean.x, splat.mean.y, splat.mean.z};
  const double lo[3] = {double{box.lo.x}, double{box.lo.y}, double{box.lo.z}};
  const double hi[3] = {double{box.hi.x}, double{box.hi.y}, double{box.hi.z}};
  double most = -1e30;
  for (std::size_t k = 0; k < 3; ++k) {
    const double half = 3 * std::sqrt(c[4 * k]);
    most = std::max({most, lo[k] - (mean[k] + half), mean[k] - half - hi[k]});
  }
  return most;
}

}  // namespace

TEST_CASE("a sieve keeps the Gaussians that a box may meet", "[source]") {
  Random random(11);
  const auto scene = random_splats(random, 3000, false);
  const store::SplatBlock block = splat_block(scene);
  std::vector<Box3f> boxes;
  for (std::size_t k = 0; k < 5; ++k) {
    const Vec3f at = Vec3f(scene[k * 100].mean);
    boxes.push_back({{at.x - 0.01F, at.y - 0.02F, at.z - 0.03F}, at});
  }
  std::vector<std::uint16_t> near{7};
  find_near(block, boxes, near);
  CHECK(std::is_sorted(near.begin(), near.end()));
  std::size_t kept = 0, left_out = 0;
  for (std::size_t i = 0; i < scene.size(); ++i) {
    double least = 1e30;
    for (const Box3f& box : boxes) least = std::min(least, gap(scene[i], box));
    const bool is_near =
        std::binary_search(near.begin(), near.end(), static_cast<std::uint16_t>(i));
    if (least <= 0) CHECK(is_near);
    if (least > 1e-4) CHECK(!is_near);
    (is_near ? kept : left_out) += 1;
  }
  CHECK(kept > 20);
  CHECK(left_out > 20);
  find_near(block, {}, near);
  CHECK(near.empty());
}

TEST_CASE("a set of two parts of a block is the set of the block", "[source]") {
  Random random(12);
  const store::SplatBlock block = splat_block(random_splats(random, 1001, false));
  const SplatSet whole = make_splat_set(block);
  std::vector<std::uint16_t> low, high;
  for (std::uint16_t i = 0; i < 1001; ++i) (i < 403 ? low : high).push_back(i);
  SplatSet parts;
  for (int round = 0; round < 2; ++round) {  // its room is used again
    parts.clear();
    parts.reserve(1001, 0);
    add_splats(block, low, SphericalHarmonics::mean, parts);
    finish(parts);
    CHECK(parts.levels[0].count == 403);
    add_splats(block, high, SphericalHarmonics::mean, parts);
    finish(parts);
    REQUIRE(parts.shapes.size() == 1001);
    for (std::size_t i = 0; i < 1001; ++i) {
      CHECK(std::memcmp(parts.shapes[i].mean, whole.shapes[i].mean, sizeof whole.shapes[i].mean) ==
            0);
      CHECK(parts.shapes[i].variance[0] == whole.shapes[i].variance[0]);
    }
    for (std::size_t level = 0; level < 3; ++level) {
      CHECK(parts.levels[level].count == whole.levels[level].count);
      CHECK(parts.levels[level].radius == whole.levels[level].radius);
    }
    CHECK(parts.covariance == whole.covariance);
  }
}
