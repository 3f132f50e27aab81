// SPDX-License-Identifier: Apache-2.0
#include "core/directions.h"

#include <catch2/catch.hpp>

#include "support/random.h"

namespace pounce {
namespace {

double apart(Vec3d a, Vec3d b) { return length(a - b); }

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

TEST_CASE("a frame's third axis is where v falls", "[core]") {
  // u to the right, v down the image: up in the image is +y for a right-handed frame.
  const TangentFrame right{{0, 0, 2}, {3, 0, 0}, 1}, left{{0, 0, 2}, {3, 0, 0}, -1};
  CHECK(right.bitangent() == Vec3d{0, 6, 0});
  CHECK(left.bitangent() == Vec3d{0, -6, 0});
  CHECK(in_space(right, {1, 1, 1}) == Vec3d{3, 6, 2});
}

TEST_CASE("a vector comes back from space as it was, however skew its frame is", "[core]") {
  for (const double handedness : {1.0, -1.0}) {
    const TangentFrame frame{{0.3, -0.2, 0.8}, {0.7, 0.4, 0.1}, handedness};
    const Vec3d v = unit_vector({0.2, -0.5, 0.7});
    CHECK(apart(in_frame(frame, in_space(frame, v)), v) < 1e-12);
    CHECK(apart(in_frame(frame, in_space(frame, v) * 5.0), v) < 1e-12);
  }
}

TEST_CASE("a frame without a tangent of its own gets some other", "[core]") {
  for (const Vec3d tangent : {Vec3d{}, Vec3d{0, 0, 1}}) {
    const TangentFrame frame = usable({{0, 0, 1}, tangent, 1});
    CHECK(dot(frame.tangent, frame.normal) == 0);
    CHECK(length(frame.tangent) == Approx(1));
    CHECK(apart(in_frame(frame, {0, 0, 4}), {0, 0, 1}) < 1e-12);
  }
  const TangentFrame good{{0, 0, 1}, {1, 0, 0.5}, 1};
  CHECK(usable(good).tangent == good.tangent);
}

TEST_CASE("the least turn takes one direction to the other and keeps what is across", "[core]") {
  const Vec3d from{0, 0, 1}, to = unit_vector({0, 1, 1});
  CHECK(apart(turned(from, from, to), to) < 1e-12);
  CHECK(apart(turned({1, 0, 0}, from, to), {1, 0, 0}) < 1e-12);
  CHECK(apart(turned({0, 1, 0}, from, to), unit_vector({0, 1, -1})) < 1e-12);
  CHECK(turned({0.1, 0.2, 0.3}, from, from) == Vec3d{0.1, 0.2, 0.3});
  CHECK(turned({0, 1, 0}, from, {0, 0, -1}) == Vec3d{0, 1, 0});
}

}  // namespace
}  // namespace pounce
