// SPDX-License-Identifier: Apache-2.0
#include "core/axes.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "core/exp.h"
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

TEST_CASE("the exponential without a library is that of the library", "[core]") {
  for (double x = -690; x < 690; x += 0.37) {
    CAPTURE(x);
    if (std::abs(exp_same(x) / std::exp(x) - 1) > 2e-11) FAIL("too far off");
  }
  CHECK(exp_same(0) == 1);
  CHECK(std::isnan(exp_same(std::numeric_limits<double>::quiet_NaN())));
  CHECK(exp_same(-std::numeric_limits<double>::infinity()) < 1e-300);
  CHECK(exp_same(std::numeric_limits<double>::infinity()) > 1e300);
}

}  // namespace
}  // namespace pounce
