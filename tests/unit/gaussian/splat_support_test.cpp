// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "gaussian/splat_statistics.h"

namespace pounce::gaussian {
namespace {

/// A row of Gaussians one apart, half opaque.
std::vector<store::Splat> row(std::size_t count) {
  std::vector<store::Splat> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    out[i].mean = {static_cast<float>(i), 0, 0};
    out[i].sigma = {0.125F, 0.125F, 0.125F};
    out[i].alpha = 0.5F;
  }
  return out;
}

}  // namespace

TEST_CASE("what has neighbours keeps its opacity, what floats alone fades", "[source]") {
  // The 8th nearest in a row is 4 away: the usual spacing. Neighbours count within 4.125.
  auto block = row(200);
  block[50].mean = {50, 100, 0};    // alone
  block[80].mean = {105, 0.5F, 0};  // near others, which come 21 to 29 later
  block[120].mean = {120, 4, 0};    // its two neighbours are 4.123 away, the next 4.5
  block[150].mean = {150, 100, 0};  // alone, but large enough to reach the row
  block[150].sigma = {97, 1, 1};
  const auto before = block;
  fade_isolated(block);
  for (std::size_t i = 0; i < block.size(); ++i) {
    CAPTURE(i);
    const float expected = i == 50 ? 0.5F / 64 : i == 120 ? 0.5F * 2 / 4 : 0.5F;
    CHECK(block[i].alpha == expected);
    store::Splat same = block[i];
    same.alpha = before[i].alpha;
    CHECK(same == before[i]);
  }
}

TEST_CASE("small blocks say nothing of neighbours", "[source]") {
  auto block = row(16);
  block[5].mean = {0, 1000, 0};
  const auto before = block;
  fade_isolated(block);
  CHECK(block == before);
}

}  // namespace pounce::gaussian
