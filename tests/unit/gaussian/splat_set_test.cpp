// SPDX-License-Identifier: Apache-2.0
#include "gaussian/splat_set.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "core/portable_math.h"
#include "gaussian/splat_statistics.h"
#include "support/splat_scenes.h"

using namespace pounce;
using namespace pounce::gaussian;
using namespace pounce::test;

namespace {

Vec3d axis(const SplatShape& shape, std::size_t k) {
  return {shape.axis[k][0], shape.axis[k][1], shape.axis[k][2]};
}

SplatShape shape_of(const ReferenceSplat& splat) {
  return make_splat_set(splat_block({splat})).shapes[0];
}

}  // namespace

TEST_CASE("a Gaussian's axes are sorted, right-handed and keep its covariance", "[source]") {
  Random random(3);
  for (const ReferenceSplat& splat : random_splats(random, 500, false)) {
    const SplatShape shape = shape_of(splat);
    CHECK(shape.variance[0] >= shape.variance[1]);
    CHECK(shape.variance[1] >= shape.variance[2]);
    CHECK(length(cross(axis(shape, 0), axis(shape, 1)) - axis(shape, 2)) < 1e-5);
    const auto expected = covariance(splat);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        double sum = 0;
        for (std::size_t k = 0; k < 3; ++k)
          sum += double{shape.axis[k][i]} * double{shape.variance[k]} * double{shape.axis[k][j]};
        CHECK(sum == Approx(expected[3 * i + j]).margin(1e-5 * double{shape.variance[0]}));
      }
    }
  }
}

TEST_CASE("flatness is planarity x needle factor", "[source]") {
  ReferenceSplat splat;
  splat.alpha = 0.5;
  splat.sigma = {2, 4, 1};  // planarity 1 - 1/2, needle 2/4
  CHECK(shape_of(splat).alpha == 0.5F);
  CHECK(shape_of(splat).flatness == Approx(0.25));
  splat.sigma = {2, 2, 2};  // a ball is next to nothing
  CHECK(shape_of(splat).flatness == Approx(0.02));
  splat.sigma = {2, 0, 0};  // a thread is nothing
  CHECK(shape_of(splat).flatness == 0);
  splat.sigma = {3, 3, 0};  // "2dgs"
  CHECK(shape_of(splat).flatness == Approx(1));
}

TEST_CASE("a scene's shape and size are medians of its Gaussians'", "[source]") {
  std::vector<store::Splat> splats(3);
  splats[0].sigma = {4, 1, 2};      // 0.5, in whatever order
  splats[1].sigma = {0, 3, 3};      // 1
  splats[2].sigma = {1, 10, 0.1F};  // 0.1
  CHECK(median_roundness(splats) == 0.5F);
  CHECK(median_roundness({}) == 1);
  CHECK(median_size(splats) == 4);  // of 4, 3 and 10
  CHECK(median_size({}) == 0);
  CHECK(fine_edge(4) == 7);
  splats.push_back(splats[0]);
  CHECK(quartile_thickness(splats) == 0.1F);  // of 0.5, 0, 0.1 and 0.5
  CHECK(quartile_thickness({}) == 0);
}

TEST_CASE("discs are round and thin", "[source]") {
  CHECK(discness(0.33F, 0.1F) == 0);
  CHECK(discness(0.45F, 0) == 0);
  CHECK(discness(0.575F, 0.15F) == Approx(0.5));
  CHECK(discness(0.78F, 0.15F) == 1);
  CHECK(discness(0.78F, 0.25F) == 1);
  CHECK(discness(0.78F, 0.35F) == Approx(0.5));
  CHECK(discness(0.78F, 0.45F) == 0);  // balls
  CHECK(discness(0.73F, 0.47F) == 0);
}

TEST_CASE("covariances are those of the shapes", "[source]") {
  Random random(4);
  const auto scene = random_splats(random, 50, false);
  const SplatSet set = make_splat_set(splat_block(scene));
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const auto expected = covariance(scene[i]);
    std::size_t c = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = a; b < 3; ++b) {
        CHECK(set.covariance[c++][i] ==
              Approx(expected[3 * a + b]).margin(1e-5 * double{set.shapes[i].variance[0]}));
      }
    }
  }
}

TEST_CASE("the file's normal counts, the shortest axis stands in", "[source]") {
  ReferenceSplat splat;
  splat.sigma = {1, 0.1, 1};
  SplatShape shape = shape_of(splat);
  CHECK(shape.two_sided == 1);
  CHECK(std::abs(shape.normal[1]) == Approx(1));
  splat.normal = {0, 0, -1};
  shape = shape_of(splat);
  CHECK(shape.two_sided == 0);
  CHECK(shape.normal[2] == Approx(-1));
}

TEST_CASE("colours are clamped where sums would end", "[source]") {
  ReferenceSplat splat;
  splat.sigma = {1, 1, 0.1};
  splat.colour = {-0.25, 1.25, 1e30};
  const SplatShape shape = shape_of(splat);
  CHECK(shape.colour[0] == 0);
  CHECK(shape.colour[1] == 1.25F);
  CHECK(shape.colour[2] == kLargestSplatColour);
}

TEST_CASE("every sphere of the tree holds its children", "[source]") {
  Random random(8);
  const SplatSet set = make_splat_set(splat_block(random_splats(random, 3001, false)));
  CHECK(set.levels[0].count == 3001);
  CHECK(set.levels[1].count == 188);
  CHECK(set.levels[2].count == 12);
  const auto centre = [](const SplatSpheres& s, std::size_t i) {
    return Vec3d{s.centre[0][i], s.centre[1][i], s.centre[2][i]};
  };
  for (std::size_t level = 0; level < 2; ++level) {
    const SplatSpheres &low = set.levels[level], &high = set.levels[level + 1];
    for (std::size_t i = 0; i < low.count; ++i) {
      const double away = length(centre(low, i) - centre(high, i / 16));
      CHECK(away + double{low.radius[i]} <= double{high.radius[i / 16]});
    }
  }
  CHECK(SplatSet::most_bytes(3001, 0) >= 3001 * (sizeof(SplatShape) + 16));
}

TEST_CASE("harmonics are weighted by degree, one Gaussian after the other", "[source]") {
  std::vector<store::Splat> splats(2);
  for (store::Splat& s : splats) s.sigma = {1, 1, 1};
  splats[1].colour = {-1, 0.5F, 9};
  std::vector<std::uint16_t> halves;
  for (int i = 0; i < 2 * 45; ++i) halves.push_back(float_to_half(static_cast<float>(i)));
  store::SplatBlock block;
  block.assign(splats, 15, halves);
  const SplatSet all = make_splat_set(block, SphericalHarmonics::normal);
  CHECK(all.shapes[1].lobes == 15);
  CHECK(all.shapes[1].colour[0] == -1);  // what is added may bring it back
  for (int i = 0; i < 45; ++i) CHECK(all.shapes[1].sh[i] == static_cast<float>(45 + i));
  const SplatSet mean = make_splat_set(block, SphericalHarmonics::mean);
  CHECK(mean.shapes[1].lobes == 8);  // degree 3 is 0
  for (int i = 0; i < 24; ++i) {
    const double weight = i < 9 ? 2.0 / 3 : 0.25;
    CHECK(double{mean.shapes[1].sh[i]} == Approx(weight * (45 + i)));
  }
  const SplatSet dc = make_splat_set(block, SphericalHarmonics::dc);
  CHECK(dc.shapes[1].lobes == 0);
  CHECK(dc.shapes[1].colour[0] == 0);
  CHECK(dc.shapes[1].colour[2] == 8);
  CHECK(SplatSet::most_bytes(1000, 15) >= SplatSet::most_bytes(1000, 0) + 1000 * 45 * 4);
}
