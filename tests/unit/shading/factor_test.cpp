// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>

#include "core/colour_space.h"
#include "shading/texel_input.h"

using namespace pounce;
using namespace pounce::shading;

namespace {

Factor colour(std::array<double, 4> scale) {
  const bool is_grey = scale[0] == scale[1] && scale[1] == scale[2];
  return {scale, {}, true, !is_grey};
}

TexelValue applied(const Factor& factor, TexelValue value, bool into_linear = false) {
  apply(factor, {4, Depth::float32, into_linear, true, true}, value);
  return value;
}

}  // namespace

TEST_CASE("a colour's factor is of linear light", "[texture]") {
  // sRGB 188 is 0.502886 in linear light; half of that is 137.32 of 255. 255 by 0.25: 136.96.
  const TexelValue out =
      applied(colour({.5, .25, 1, 1}), {{188 / 255.0, 1, .123456789, 0}, 3, false, false});
  CHECK(out.channels == 3);
  CHECK(out.v[0] * 255 == Approx(137.3227).margin(1e-3));
  CHECK(out.v[1] * 255 == Approx(136.9602).margin(1e-3));
  CHECK(out.v[2] == .123456789);  // as it was, bit by bit
  const TexelValue linear = applied(colour({.5, .25, 2, 1}), {{.5, 1, .75, 0}, 3, true, false});
  CHECK(linear.v == std::array<double, 4>{.25, .25, 1.5, 0});
}

TEST_CASE("into a linear format a colour is converted once", "[texture]") {
  const TexelValue out = applied(colour({.5, 1, 1, 1}), {{.5, .5, 0, .25}, 4, false, true}, true);
  CHECK(out.linear);
  CHECK(out.v[1] == srgb_to_linear(.5));
  CHECK(out.v[0] == .5 * srgb_to_linear(.5));
  CHECK(out.v[3] == .25);
}

TEST_CASE("alpha's factor is applied as it is, and makes one where there is none", "[texture]") {
  const TexelValue had = applied(colour({1, 1, 1, .5}), {{.2, .3, .4, .5}, 4, false, true});
  CHECK(had.v == std::array<double, 4>{.2, .3, .4, .25});
  const TexelValue none = applied(colour({1, 1, 1, .5}), {{.2, .3, .4, 0}, 3, false, false});
  CHECK(none.v == std::array<double, 4>{.2, .3, .4, .5});
  CHECK((none.has_alpha && none.channels == 4));
  TexelValue times{{.2, .25, .5, .5}, 4, true, true};
  times.premultiplied = true;
  CHECK(applied(colour({1, 1, .5, .5}), times).v == std::array<double, 4>{.1, .125, .125, .25});
}

TEST_CASE("grey takes colour from a factor that has one", "[texture]") {
  const TexelValue grey = applied(colour({.5, .5, .5, 1}), {{1, 0, 0, 0}, 1, true, false});
  CHECK((grey.channels == 1 && grey.v[0] == .5));
  const TexelValue tinted = applied(colour({1, .5, .25, 1}), {{1, .75, 0, 0}, 2, true, true});
  CHECK(tinted.channels == 4);
  CHECK(tinted.v == std::array<double, 4>{1, .5, .25, .75});
}

TEST_CASE("data is scaled channel by channel", "[texture]") {
  // Roughness 0.5 in green, metallic 0.25 in blue; occlusion of strength 0.5 in red: 1 + 0.5 (v -
  // 1).
  const TexelValue in{{.2, .8, .4, 0}, 3, false, false};
  CHECK(applied({{1, .5, .25, 1}}, in).v == std::array<double, 4>{.2, .4, .1, 0});
  CHECK(applied({{.5, 1, 1, 1}, {.5, 0, 0}}, in).v == std::array<double, 4>{.6, .8, .4, 0});
}
