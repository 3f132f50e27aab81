// SPDX-License-Identifier: Apache-2.0
#include "core/colour_space.h"

#include <catch2/catch.hpp>

using namespace pounce;

namespace {

ColourSpace space(const char* name) {
  const auto found = colour_space_from_name(name);
  REQUIRE(found);
  return *found;
}

void check_matrix(const Matrix3& got, const Matrix3& expected) {
  for (std::size_t i = 0; i < 9; ++i) {
    CAPTURE(i);
    CHECK(got[i] == Approx(expected[i]).margin(2e-5));
  }
}

}  // namespace

TEST_CASE("matrices between spaces are those that are published") {
  // ACES' AP1 to Rec. 709 with Bradford's adaptation, as ACES' own ODT has it.
  check_matrix(
      primaries_matrix(space("acescg").primaries, kRec709),
      {1.70505, -0.62179, -0.08326, -0.13026, 1.14080, -0.01055, -0.02400, -0.12897, 1.15297});
  // AP0 to AP1: TRANSFER of S-2014-004. One white.
  check_matrix(primaries_matrix(space("aces2065-1").primaries, space("acescg").primaries),
               {1.4514393161, -0.2365107469, -0.2149285693, -0.0765537734, 1.1762296998,
                -0.0996759264, 0.0083161484, -0.0060324498, 0.9977163014});
  // Display P3 to sRGB, one white.
  check_matrix(primaries_matrix(space("display-p3").primaries, kRec709),
               {1.2249401763, -0.2249401763, 0, -0.0420569547, 1.0420569547, 0, -0.0196375546,
                -0.0786360456, 1.0982736001});
}

TEST_CASE("a matrix keeps white, and there and back is nothing") {
  const Chromaticities p3 = space("display-p3").primaries, ap0 = space("aces2065-1").primaries;
  const Matrix3 there = primaries_matrix(p3, ap0), back = primaries_matrix(ap0, p3);
  for (std::size_t row = 0; row < 3; ++row) {
    CHECK(there[3 * row] + there[3 * row + 1] + there[3 * row + 2] == Approx(1).margin(1e-12));
    for (std::size_t column = 0; column < 3; ++column) {
      double sum = 0;
      for (std::size_t i = 0; i < 3; ++i) sum += back[3 * row + i] * there[3 * i + column];
      CHECK(sum == Approx(row == column ? 1 : 0).margin(1e-12));
    }
  }
}

TEST_CASE("CIE XYZ is turned into Rec. 709 without a tint") {
  const Chromaticities xyz{1, 0, 0, 1, 0, 0, 0.333333F, 0.333333F};
  REQUIRE(are_primaries(xyz));
  // IEC 61966-2-1's matrix, with more digits.
  check_matrix(primaries_matrix(xyz, kRec709),
               {3.2409699, -1.5373832, -0.4986108, -0.9692436, 1.8759675, 0.0415551, 0.0556301,
                -0.2039770, 1.0569715});
  check_matrix(primaries_matrix(kRec709, xyz),
               {0.4123908, 0.3575843, 0.1804808, 0.2126390, 0.7151687, 0.0721923, 0.0193308,
                0.1191948, 0.9505322});
  // D65's own X, Y, Z (0.3127 / 0.3290, 1, 0.3583 / 0.3290) are white.
  const Matrix3 m = primaries_matrix(xyz, kRec709);
  for (std::size_t row = 0; row < 3; ++row) {
    CHECK(m[3 * row] * 0.950456 + m[3 * row + 1] + m[3 * row + 2] * 1.089058 ==
          Approx(1).margin(1e-5));
  }
}

TEST_CASE("the largest floats are coded as the formula says") {
  for (double light = 0.01; light < 3e38; light *= 7) {
    CAPTURE(light);
    CHECK(linear_to_srgb(light) == Approx(1.055 * std::pow(light, 1 / 2.4) - 0.055).epsilon(1e-13));
    CHECK(srgb_to_linear(linear_to_srgb(light)) == Approx(light).epsilon(1e-12));
  }
}

TEST_CASE("names are told apart from what has none") {
  CHECK(space("ACEScg").linear);
  CHECK_FALSE(space("Display-P3").linear);
  CHECK(same_primaries(space("linear").primaries, kRec709));
  CHECK_FALSE(colour_space_from_name("rec2020"));
  CHECK(colour_space_name({space("acescg").primaries, true}) == "acescg");
  CHECK(colour_space_name({kRec709, false}) == "srgb");
  CHECK(colour_space_name({kRec709, true}) == "lin_rec709");
  CHECK(colour_space_name({space("display-p3").primaries, true}) ==
        "linear light with red 0.68 0.32, green 0.265 0.69, blue 0.15 0.06, white 0.3127 0.329");
}

TEST_CASE("what spans no colours is no space") {
  CHECK(are_primaries(kRec709));
  CHECK(are_primaries(space("aces2065-1").primaries));
  CHECK_FALSE(are_primaries({}));
  CHECK_FALSE(are_primaries({0.3F, 0.3F, 0.4F, 0.4F, 0.5F, 0.5F, 0.31F, 0.33F}));  // a line
  Chromaticities outside = kRec709;  // white is no mixture
  outside[6] = 0.7F;
  CHECK_FALSE(are_primaries(outside));
  Chromaticities not_a_number = kRec709;
  not_a_number[0] = __builtin_nanf("");
  CHECK_FALSE(are_primaries(not_a_number));
}
