// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

namespace pounce {

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

}  // namespace pounce
