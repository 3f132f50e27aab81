// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

namespace pounce {

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

}  // namespace pounce
