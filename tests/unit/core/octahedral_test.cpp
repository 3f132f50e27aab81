// SPDX-License-Identifier: Apache-2.0
#include "core/octahedral.h"

#include <catch2/catch.hpp>

#include "support/random.h"

using namespace pounce;

TEST_CASE("directions come back within 7e-5, the axes exactly, and nothing as nothing") {
  for (const float s : {1.0F, -1.0F}) {
    for (const Vec3f axis : {Vec3f{s, 0, 0}, Vec3f{0, s, 0}, Vec3f{0, 0, s}})
      CHECK(from_octahedral(to_octahedral(axis)) == axis);
  }
  CHECK(from_octahedral(to_octahedral({})) == Vec3f{});
  test::Random random(71);
  float worst = 0;
  for (int i = 0; i < 200000; ++i) {
    Vec3f n{random.between(-1.0F, 1.0F), random.between(-1.0F, 1.0F), random.between(-1.0F, 1.0F)};
    if (random.one_in(8)) n.z = 0;  // where the octahedron is folded
    if (random.one_in(8)) n.x *= 1e-6F;
    if (!(length(n) > 0)) continue;
    n = n * (1 / length(n));
    const Vec3f back = from_octahedral(to_octahedral(n));
    CHECK(std::abs(length(back) - 1) < 1e-6F);
    worst = std::max(worst, length(back - n));
  }
  CHECK(worst < 7e-5F);
}

TEST_CASE("any two numbers are a direction or none") {
  test::Random random(72);
  for (int i = 0; i < 200000; ++i) {
    const Octahedral o{static_cast<std::int16_t>(random.bits()),
                       static_cast<std::int16_t>(random.bits())};
    if (!(std::abs(length(from_octahedral(o)) - 1) < 1e-5F) && o != kNoDirection)
      FAIL(o[0] << " " << o[1]);
  }
  for (const std::int16_t a : {std::int16_t{-32768}, std::int16_t{32767}, std::int16_t{0}}) {
    for (const std::int16_t b : {std::int16_t{-32768}, std::int16_t{32767}, std::int16_t{0}})
      CHECK(std::isfinite(length(from_octahedral({a, b}))));
  }
}
