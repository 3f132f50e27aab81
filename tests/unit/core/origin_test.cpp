// SPDX-License-Identifier: Apache-2.0
#include "core/origin.h"

#include <catch2/catch.hpp>

#include "core/axes.h"

using namespace pounce;

TEST_CASE("what lies near 0 for its size has no origin", "[core]") {
  CHECK(origin_for({}) == Vec3d{});
  CHECK(origin_for({{-1, 0, 2}, {1, 3, 4}}) == Vec3d{});
  // A cube of 1, 64 times its size away: no more than that is near.
  CHECK(origin_for({{63.5F, 0, 0}, {64.5F, 1, 1}}) == Vec3d{});
  CHECK(origin_for({{64, 0, 0}, {65, 1, 1}}) != Vec3d{});
}

TEST_CASE("an origin is a multiple of the power of two above the size", "[core]") {
  // 100 m at map coordinates: multiples of 128. 448,250 = 3501.95 x 128, 5,411,950 = 42280.86 x
  // 128.
  const Vec3d map = origin_for({{448200, 5411900, 80}, {448300, 5412000, 120}});
  CHECK(map == Vec3d{3502.0 * 128, 42281.0 * 128, 128});
  // Of 10 cm single precision knows nothing there: its last place, 0.5, is the size; so multiples
  // of 1.
  const Vec3d small = origin_for({{448200, 5411900, 80}, {448200.1F, 5411900, 80.1F}});
  CHECK(small == Vec3d{448200, 5411900, 80});
}

TEST_CASE("axes are undone", "[core]") {
  for (const char* const text : {"x,y,z", "x,-z,y", "-y,z,-x", "z,x,y"}) {
    const Axes axes = parse_axes(text);
    CHECK(axes.undo(axes.apply(Vec3d{1, 2, 3})) == Vec3d{1, 2, 3});
  }
}
