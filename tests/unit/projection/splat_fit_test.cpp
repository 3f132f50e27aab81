// SPDX-License-Identifier: Apache-2.0
#include "projection/splat_fit.h"

#include <catch2/catch.hpp>
#include <vector>

using namespace pounce;
using namespace pounce::projection;

namespace {

double fit(std::vector<double> distances, std::size_t places, double reach = 1) {
  return fit_of(distances, places, reach);
}

/// So many, as far apart as the reach allows.
std::vector<double> scattered(std::size_t count) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < count; ++i)
    distances.push_back(-1 + 2 * static_cast<double>(i) / static_cast<double>(count - 1));
  return distances;
}

}  // namespace

TEST_CASE("a scene that lies at one distance everywhere fits", "[projection]") {
  CHECK(fit({0.3, 0.3, 0.3, 0.3, -0.9}, 20) == 1);
  // The median is 0.5, that of the deviations 0.15: 0.22239 of the reach.
  const std::vector<double> spread{0.2, 0.35, 0.5, 0.65, 0.8};
  CHECK(fit(spread, 20) == Approx((0.28 - 0.22239) / 0.13));
  CHECK(fit(spread, 20, 2) == 1);    // 0.111195 of it
  CHECK(fit(spread, 20, 0.5) == 0);  // 0.44478
}

TEST_CASE("a scene that nearly all places find fits, however far it strays", "[projection]") {
  CHECK(fit(scattered(90), 100) == 1);
  CHECK(fit(scattered(87), 100) == Approx(0.5));
  CHECK(fit(scattered(84), 100) == 0);
  CHECK(fit(scattered(30), 100) == 0);
}

TEST_CASE("a few places that agree by chance say little", "[projection]") {
  CHECK(fit({0.3, 0.3, 0.3}, 300) == Approx(0.2));
  CHECK(fit({0.3, 0.3, 0.3}, 60) == Approx(1));
}

TEST_CASE("a scene that no place finds does not fit", "[projection]") {
  CHECK(fit({}, 448) == 0);
  CHECK(fit({}, 0) == 0);
}
