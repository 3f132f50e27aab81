// SPDX-License-Identifier: Apache-2.0
//
// Arithmetic that is the same on every machine. The same job must give the same bytes everywhere,
// but a C library picks its exp and log by the processor. So these are made of + - * / alone, which
// IEEE 754 rounds in one way only.
#pragma once

// Convert by arithmetic: the table would have to be linked from libImath for two small functions.
#ifndef IMATH_HALF_NO_LOOKUP_TABLE
#define IMATH_HALF_NO_LOOKUP_TABLE
#endif
#include <Imath/half.h>

#include <bit>
#include <cstdint>

namespace pounce {

/// IEEE 754 binary16 to binary32, exact.
inline float half_to_float(std::uint16_t half) { return imath_half_to_float(half); }

/// binary32 to binary16, rounded to nearest even; overflow becomes infinity.
inline std::uint16_t float_to_half(float value) { return imath_float_to_half(value); }

/// e^x to 1e-11, from +, -, * alone, so that it is the same on every machine: the C library picks
/// its own exp by processor. Below -700 it is 1e-304, above 700 it is 1e304; NaN stays NaN. Loops
/// over it become vector code.
inline double exp_same(double x) {
  x = x < -700.0 ? -700.0 : x;
  x = x > 700.0 ? 700.0 : x;
  constexpr double kRound = 0x1.8p52;  // adding it leaves a whole number in the low bits
  const double shifted = x * 0x1.71547652b82fep0 + kRound;
  const double k = shifted - kRound;
  // ln 2 in two parts: the first has so few bits that k times it is exact.
  const double r = (x - k * 0x1.62e42feep-1) - k * 0x1.a39ef35793c76p-33;
  double p = 1.0 / 362880;
  p = p * r + 1.0 / 40320;
  p = p * r + 1.0 / 5040;
  p = p * r + 1.0 / 720;
  p = p * r + 1.0 / 120;
  p = p * r + 1.0 / 24;
  p = p * r + 1.0 / 6;
  p = p * r + 0.5;
  p = p * r + 1.0;
  p = p * r + 1.0;
  const auto bits = std::bit_cast<std::uint64_t>(shifted);  // low bits: k
  return p * std::bit_cast<double>((bits + 1023) << 52);
}

/// The natural logarithm of a normal positive number to 1e-15, from +, -, *, / alone, so that it is
/// the same on every machine (as exp_same() is).
inline double log_same(double x) {
  // x = 2^k m with m within sqrt(1/2) and sqrt(2): their difference in the bits leaves k.
  constexpr std::uint64_t kRootOfHalf = 0x3FE6A09E667F3BCD;
  const std::uint64_t shifted = std::bit_cast<std::uint64_t>(x) - kRootOfHalf;
  const auto k = static_cast<std::int64_t>(shifted) >> 52;
  const double m = std::bit_cast<double>(std::bit_cast<std::uint64_t>(x) -
                                         (static_cast<std::uint64_t>(k) << 52));
  // ln m = 2 artanh(s); s^2 is below 0.0295, so the next term is below 1e-18 of the sum.
  const double s = (m - 1) / (m + 1), square = s * s;
  double sum = 1.0 / 23;
  for (int odd = 21; odd >= 1; odd -= 2) sum = sum * square + 1.0 / odd;
  // ln 2 in two parts: the first has so few bits that k times it is exact.
  const auto power = static_cast<double>(k);
  return power * 0x1.62e42feep-1 + (power * 0x1.a39ef35793c76p-33 + 2 * s * sum);
}

/// The arc tangent of a number from 0 to infinity to 1e-15, from +, -, *, / alone, so that it is
/// the same on every machine (as exp_same() is).
inline double atan_same(double x) {
  constexpr double kQuarter = 0x1.921fb54442d18p-1;  // pi / 4
  const bool is_large = x > 1;
  if (is_large) x = 1 / x;
  // At most tan(pi / 8) is left, and the term after the last is below 1e-17.
  const bool is_turned = x > 0x1.a827999fcef32p-2;
  if (is_turned) x = (x - 1) / (x + 1);
  const double square = x * x;
  double sum = 1.0 / 39;
  for (int odd = 37; odd >= 1; odd -= 2) sum = 1.0 / odd - sum * square;
  const double angle = x * sum + (is_turned ? kQuarter : 0);
  return is_large ? 2 * kQuarter - angle : angle;
}

}  // namespace pounce
