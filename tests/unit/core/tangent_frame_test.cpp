// SPDX-License-Identifier: Apache-2.0
#include "core/tangent_frame.h"

#include <catch2/catch.hpp>

namespace pounce {
namespace {

double apart(Vec3d a, Vec3d b) { return length(a - b); }

}  // namespace

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

}  // namespace pounce
