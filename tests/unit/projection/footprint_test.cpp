// SPDX-License-Identifier: Apache-2.0
#include "projection/footprint.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <utility>

using namespace pounce;
using namespace pounce::projection;

namespace {

double size(Vec2d v) { return std::sqrt(v.x * v.x + v.y * v.y); }

/// The variance of a set's lookups along its first side, and of what its texels are boxes of.
double variance(const Lookups& set) {
  const double texel = std::ldexp(1.0, static_cast<int>(set.level));
  return size(set.step_a) * size(set.step_a) * (set.count_a * set.count_a - 1) / 12 +
         texel * texel / 12;
}

}  // namespace

TEST_CASE("a footprint of a texel is one lookup, rounding or not") {
  for (const double edge : {0.0, 0.5, 1.0, 1.0001, 1.015}) {
    CHECK(lookups_of({{edge, 0}, {0, edge}}, 9).single());
    CHECK(lookups_of({{0, -edge}, {0.1, 0}}, 9).single());
  }
  CHECK_FALSE(lookups_of({{1.02, 0}, {0, 1}}, 9).single());
  const double none = std::nan("");
  CHECK(lookups_of({{none, 0}, {0, none}}, 9).single());
  CHECK(lookups_of({{1e300, 0}, {0, 1e300}}, 9).single());
}

TEST_CASE("lookups spread as wide as the footprint") {
  for (double edge = 1.05; edge < 200; edge *= 1.07) {
    const FootprintLookups all = lookups_of({{edge, 0}, {0, edge}}, 9);
    double shares = 0;
    for (int s = 0; s < all.count; ++s) {
      const Lookups& set = all.sets[static_cast<std::size_t>(s)];
      const double texel = std::ldexp(1.0, static_cast<int>(set.level));
      shares += set.share;
      CAPTURE(edge, set.level, set.count_a);
      CHECK(set.count_a <= 3);
      CHECK(set.count_a == set.count_b);
      CHECK((set.level == 0 || texel <= edge / 1.3));
      // A box's variance, less the 1/64 of a texel that counts as none.
      CHECK(std::abs(variance(set) - edge * edge / 12) < 0.04 * texel * texel / 12);
    }
    CHECK(std::abs(shares - 1) < 1e-12);
  }
}

TEST_CASE("what the lookups are changes by little where the footprint does") {
  double before = 0;
  std::uint32_t levels = 0;
  for (double edge = 1; edge < 100; edge *= 1.0005) {
    const FootprintLookups all = lookups_of({{edge, 0}, {0, edge}}, 9);
    double level = 0;
    for (int s = 0; s < all.count; ++s) {
      const Lookups& set = all.sets[static_cast<std::size_t>(s)];
      level += set.share * set.level;
      levels = std::max(levels, set.level);
    }
    CAPTURE(edge);
    CHECK(std::abs(level - before) < 0.01);
    before = level;
  }
  CHECK(levels == 6);
}

TEST_CASE("a long footprint is many lookups of a fine level, along it alone") {
  const FootprintLookups all = lookups_of({{12, 16}, {-0.8, 0.6}}, 9);  // 20 by 1
  REQUIRE(all.count == 1);
  CHECK(all.sets[0].level == 0);
  CHECK(all.sets[0].count_a == 14);
  CHECK(all.sets[0].count_b == 1);
  CHECK(std::abs(all.sets[0].step_a.x / all.sets[0].step_a.y - 0.75) < 1e-12);
  // However long, the work is bounded.
  const FootprintLookups longest = lookups_of({{4000, 0}, {0, 1}}, 9);
  CHECK(longest.sets[0].count_a <= 16);
  CHECK(longest.sets[0].level >= 7);
  CHECK(lookups_of({{4000, 0}, {0, 4000}}, 3).sets[0].level == 3);
}

TEST_CASE("a footprint is the target's axes in texels of the source") {
  const TexelGradients by{{2, 0, 0}, {0, 3, 0}};
  const Footprint own = footprint_of(by, {0.5F, 0, 7}, {1, 1, 7});
  CHECK((own.a == Vec2d{1, 0} && own.b == Vec2d{2, 3}));
  // Of an edge alone: the same area, whatever way the source's image lies.
  const Footprint square = footprint_of({{2, 0, 0}, {1, 3, 0}}, 0.5F);
  CHECK(std::abs(square.a.x * square.b.y - square.a.y * square.b.x - 1.5) < 1e-6);
  CHECK(size(footprint_of({{0, 0, 0}, {0, 3, 0}}, 0.5F).a) == 1.5);
}

TEST_CASE("a target finer than its source is sharpened by how much finer it is, along each axis") {
  const auto of = [](Vec2d a, Vec2d b) {
    const Sharpening out = lookups_of({a, b}, 9).sharpening;
    return std::pair{out.across, out.down};
  };
  // 1/24 less s^2 of it; sides of 63/64 count as whole: 43690 (1 - (32/63)^2).
  CHECK(of({0.5, 0}, {0, 0.5}) == std::pair{32418, 32418});
  CHECK(of({0.5, 0}, {0, 1}) == std::pair{32418, 0});
  CHECK(of({0, 0.5}, {-0.25, 0}) == std::pair{40872, 32418});
  // A texel that is turned is as wide: half of 0.5^2 from either side.
  CHECK(of({0.3, 0.4}, {-0.4, 0.3}) == std::pair{32418, 32418});
  // Along the other side it may be coarse: then lookups are spread there.
  CHECK(of({0.5, 0}, {0, 4}) == std::pair{32418, 0});
  CHECK(of({0, 0}, {0, 0}) == std::pair{43690, 43690});
  for (const double edge : {0.9844, 0.9999, 1.0, 1.0001, 3.0, 1e300, std::nan("")})
    CHECK(of({edge, 0}, {0, -edge}) == std::pair{0, 0});
  std::int32_t before = 43690;
  for (double edge = 0; edge < 1.1; edge += 0.001) {
    const auto [across, down] = of({edge, 0}, {0, edge});
    CHECK(across <= before);
    CHECK(before - across < 100);
    before = across;
  }
  CHECK(before == 0);
}
