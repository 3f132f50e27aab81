// SPDX-License-Identifier: Apache-2.0
#include "core/portable_math.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "support/random.h"

using namespace pounce;

namespace {

/// The definition of binary16.
double value_of(std::uint16_t bits) {
  const int exponent = bits >> 10 & 31, mantissa = bits & 1023;
  const double sign = (bits & 0x8000) != 0 ? -1 : 1;
  if (exponent == 31)
    return mantissa != 0 ? std::numeric_limits<double>::quiet_NaN()
                         : sign * std::numeric_limits<double>::infinity();
  if (exponent == 0) return sign * std::ldexp(mantissa, -24);
  return sign * std::ldexp(1024 + mantissa, exponent - 25);
}

}  // namespace

TEST_CASE("all 65536 halves mean what binary16 says and come back") {
  for (std::uint32_t i = 0; i < 65536; ++i) {
    const auto bits = static_cast<std::uint16_t>(i);
    const double expected = value_of(bits);
    const float got = half_to_float(bits);
    if (std::isnan(expected)) {
      if (!std::isnan(got) || (float_to_half(got) & 0x7C00) != 0x7C00 ||
          (float_to_half(got) & 0x3FF) == 0) {
        FAIL("NaN " << i);
      }
      continue;
    }
    if (double{got} != expected || std::signbit(got) != std::signbit(expected))
      FAIL(i << " is " << got << " instead of " << expected);
    if (float_to_half(got) != bits) FAIL(i << " comes back as " << float_to_half(got));
  }
}

TEST_CASE("halfway between two halves, the even one is taken; beyond halfway, the nearer") {
  for (std::uint32_t i = 0; i < 0x7BFF; ++i) {
    const auto low = static_cast<std::uint16_t>(i), high = static_cast<std::uint16_t>(i + 1);
    const auto middle = static_cast<float>((value_of(low) + value_of(high)) / 2);  // exact
    const float above = std::nextafter(middle, 1e9F), below = std::nextafter(middle, -1.0F);
    if (float_to_half(middle) != (i % 2 == 0 ? low : high) || float_to_half(above) != high ||
        float_to_half(below) != low || float_to_half(-above) != (high | 0x8000)) {
      FAIL("between " << i << " and " << i + 1);
    }
  }
}

TEST_CASE("the ends of the range of halves") {
  CHECK(float_to_half(65504.0F) == 0x7BFF);
  CHECK(float_to_half(65519.996F) == 0x7BFF);
  CHECK(float_to_half(65520.0F) == 0x7C00);  // rounds to 65536: infinity
  CHECK(float_to_half(-1e30F) == 0xFC00);
  CHECK(float_to_half(std::numeric_limits<float>::infinity()) == 0x7C00);
  CHECK(float_to_half(0x1p-24F) == 1);
  CHECK(float_to_half(0x1p-25F) == 0);
  CHECK(float_to_half(0x1.000002p-25F) == 1);
  CHECK(float_to_half(0x1.8p-24F) == 2);
  CHECK(float_to_half(1e-45F) == 0);
  CHECK(float_to_half(-0.0F) == 0x8000);
  CHECK(float_to_half(0x1.ff8p-15F) == 0x03FF);     // the largest subnormal
  CHECK(float_to_half(0x1.fffffep-15F) == 0x0400);  // rounds up to the smallest normal
}

TEST_CASE("random floats go to one of the two halves around them, the nearer") {
  pounce::test::Random random(81);
  for (int i = 0; i < 200000; ++i) {
    const auto value = static_cast<float>(
        std::ldexp(random.between(-2.0, 2.0), static_cast<int>(random.whole(-30, 14))));
    const std::uint16_t bits = float_to_half(value);
    const double off = std::abs(value_of(bits) - value);
    for (const int step : {-1, 1}) {
      const auto other = static_cast<std::uint16_t>(bits + step);
      if ((bits & 0x7FFF) == 0 && step < 0) continue;
      if (std::abs(value_of(other) - value) < off) FAIL(value << " goes to " << value_of(bits));
    }
  }
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
