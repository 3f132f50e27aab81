// SPDX-License-Identifier: Apache-2.0
#include "core/job_space.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "pounce/error.h"

namespace pounce {
namespace {

TEST_CASE("axes are read, applied and written", "[core]") {
  const Axes axes = parse_axes("z,-x,+y");
  CHECK(axes.apply(Vec3f{1, 2, 3}) == Vec3f{3, -1, 2});
  CHECK(to_text(axes) == "z,-x,y");
  CHECK(parse_axes("x,y,z") == Axes{});
  for (const char* bad : {"", "x", "x,y", "x,y,z,", "x,y,y", "x,,z", "x,y,w", "X,Y,Z", "x, y,z",
                          "--x,y,z", "x,y,z,x"}) {
    CAPTURE(bad);
    CHECK_THROWS_AS(parse_axes(bad), Error);
  }
}

TEST_CASE("a permutation of determinant -1 mirrors", "[core]") {
  for (const char* even : {"x,y,z", "x,-y,-z", "y,z,x", "z,x,y", "x,z,-y", "-y,x,z"}) {
    CAPTURE(even);
    CHECK_FALSE(parse_axes(even).mirrors());
  }
  for (const char* odd : {"-x,y,z", "-x,-y,-z", "y,x,z", "z,y,x", "x,z,y", "-y,z,x"}) {
    CAPTURE(odd);
    CHECK(parse_axes(odd).mirrors());
  }
}

TEST_CASE("an ellipsoid turns with its axes", "[core]") {
  // 180 degrees about x: as in the table of signs for splat files, (w, x, y, z) -> (w, x, -y, -z).
  Vec3f sigma{1, 2, 3};
  std::array<float, 4> q{0.1F, 0.2F, 0.3F, 0.4F};
  parse_axes("x,-y,-z").apply(sigma, q);
  CHECK(sigma == Vec3f{1, 2, 3});
  CHECK(q == std::array<float, 4>{0.1F, 0.2F, -0.3F, -0.4F});
  // A mirror in x: (w, sy sz x, sx sz y, sx sy z).
  q = {0.1F, 0.2F, 0.3F, 0.4F};
  parse_axes("-x,y,z").apply(sigma, q);
  CHECK(q == std::array<float, 4>{0.1F, 0.2F, -0.3F, -0.4F});
  // A cycle moves the sizes as well.
  parse_axes("z,x,y").apply(sigma, q);
  CHECK(sigma == Vec3f{3, 1, 2});
  CHECK(q == std::array<float, 4>{0.1F, -0.4F, 0.2F, -0.3F});
}

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

}  // namespace
}  // namespace pounce
