// SPDX-License-Identifier: Apache-2.0
#include "projection/splat_fit.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

using namespace pounce;
using namespace pounce::projection;

namespace {

/// Places on a line, farther and farther apart, so that no two are equally far from a third.
std::vector<FoundPlace> on_a_line(const std::vector<double>& distances) {
  std::vector<FoundPlace> found;
  for (const double distance : distances) {
    const auto i = static_cast<float>(found.size());
    found.push_back({{i + i * i / 4096, 0, 0}, distance});
  }
  return found;
}

double fit(const std::vector<double>& distances, std::size_t places,
           const FitLengths& lengths = {1, 1}) {
  return fit_of(on_a_line(distances), places, lengths).fit;
}

/// So many, far apart from place to place; of any 25 neighbours the median is 0.
std::vector<double> scattered(std::size_t count) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < count; ++i)
    distances.push_back(0.8 * (static_cast<double>(i % 3) - 1));
  return distances;
}

/// A hundred: `part` of them on one side of the target by `off`, the others on the other side.
std::vector<double> two_regions(double off, std::size_t part = 50) {
  std::vector<double> distances(100, -off);
  std::fill_n(distances.begin(), part, off);
  return distances;
}

}  // namespace

TEST_CASE("a scene that lies at one distance everywhere fits", "[projection]") {
  CHECK(fit({0.3, 0.3, 0.3, 0.3, -0.9}, 20) == 1);
  // The median is 0.5, that of the deviations 0.12: 0.177912 of the reach.
  const std::vector<double> spread{0.26, 0.38, 0.5, 0.62, 0.74};
  CHECK(fit(spread, 20) == Approx((0.28 - 0.177912) / 0.13));
  CHECK(fit(spread, 20, {2, 2}) == 1);    // 0.088956 of it
  CHECK(fit(spread, 20, {0.5, 2}) == 0);  // 0.355824
}

TEST_CASE("a fit says where most places found the scene", "[projection]") {
  // Eleven: the median is 0.1; |d - 0.1| in order 0 (six times), 0.02, 0.02, 0.03, 0.1, 0.7.
  const std::vector<double> distances{0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.08, 0.12, 0.07, 0.2, 0.8};
  const SplatFit found = fit_of(on_a_line(distances), 11, {1, 1});
  CHECK(found.middle == 0.1);
  CHECK(found.spread == Approx(0.1));
  CHECK(found.distance == Approx(0.2));
}

TEST_CASE("a scene that lies at one distance that is large does not fit", "[projection]") {
  const auto at = [](double distance) { return std::vector<double>(100, distance); };
  CHECK(fit(at(0.55), 100) == 1);
  CHECK(fit(at(-0.59), 100) == Approx(0.6));
  CHECK(fit(at(0.61), 100) == 0);
  CHECK(fit(at(-0.9), 100) == 0);
  CHECK(fit(at(0.9), 100, {1, 1.8}) == 1);  // the reach is held back
}

TEST_CASE("a scene that fits less than half does not fit", "[projection]") {
  CHECK(fit({0.22, 0.36, 0.5, 0.64, 0.78}, 20) == Approx((0.28 - 0.207564) / 0.13));
  CHECK(fit({0.20, 0.35, 0.5, 0.65, 0.80}, 20) == 0);  // 0.22239: 0.44
  CHECK(fit(scattered(86), 100) == 0);                 // 0.33
}

TEST_CASE("a scene that nearly all places find fits, however far it scatters", "[projection]") {
  CHECK(fit(scattered(90), 100) == 1);
  CHECK(fit(scattered(88), 100) == Approx(2.0 / 3));
  CHECK(fit(scattered(84), 100) == 0);
  CHECK(fit(scattered(30), 100) == 0);
}

TEST_CASE("a scene that lies off over whole regions does not fit", "[projection]") {
  CHECK(fit(two_regions(0.40), 100) == 1);
  CHECK(fit(two_regions(0.41), 100) == Approx(0.75));
  CHECK(fit(two_regions(0.43), 100) == 0);
  CHECK(fit(two_regions(0.9), 100) == 0);
  // By what the reach is when nothing holds it back.
  CHECK(fit(two_regions(0.9), 100, {1, 2.5}) == 1);
  CHECK(fit(two_regions(0.9), 100, {1, 2}) == 0);
  // Three quarters of the places count.
  for (const std::size_t off : {20, 30}) {
    std::vector<double> some;
    for (std::size_t i = 0; i < 100; ++i)
      some.push_back(i < off ? 0.9 : 0.3 * (static_cast<double>(i % 3) - 1));
    CHECK(fit(some, 100) == (off == 20 ? 1 : 0));
  }
}

TEST_CASE("neighbours are those that lie near, in whatever order", "[projection]") {
  for (const double off : {0.41, 0.9}) {
    std::vector<FoundPlace> found = on_a_line(two_regions(off));
    const double expected = fit_of(found, 100, {1, 1}).fit;
    std::vector<FoundPlace> mixed;
    for (std::size_t i = 0; i < 100; ++i) mixed.push_back(found[i * 37 % 100]);
    CHECK(fit_of(mixed, 100, {1, 1}).fit == expected);
  }
}

TEST_CASE("a few places that agree by chance say little", "[projection]") {
  CHECK(fit({0.3, 0.3, 0.3}, 300) == Approx(0.2));
  CHECK(fit({0.3, 0.3, 0.3}, 60) == Approx(1));
}

TEST_CASE("a scene that no place finds does not fit", "[projection]") {
  CHECK(fit({}, 448) == 0);
  CHECK(fit({}, 0) == 0);
}

TEST_CASE("it is known how far away a scene lies at nine places in ten", "[projection]") {
  std::vector<double> distances;
  for (int i = 0; i < 20; ++i) distances.push_back(i % 2 == 0 ? i : -i);
  CHECK(fit_of(on_a_line(distances), 20, {100, 100}).distance == 18);
  CHECK(fit_of({}, 20, {100, 100}).distance == 0);
}
