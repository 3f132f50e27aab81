// SPDX-License-Identifier: Apache-2.0
#include "core/srgb.h"

#include <algorithm>
#include <cmath>

namespace pounce {
namespace {

/// The positive root of r^n = x for x > 0 by Newton's method, from a start above the root: each
/// step falls until rounding stops it.
double root(double x, int n) noexcept {
  double r = std::max(x, 1.0);
  for (int i = 0; i < 200; ++i) {
    double power = 1;
    for (int k = 1; k < n; ++k) power *= r;
    const double next = r - (r - x / power) / n;
    if (!(next < r)) break;
    r = next;
  }
  return r;
}

}  // namespace

// IEC 61966-2-1. x^2.4 = x^2 * (x^2)^(1/5); x^(1/2.4) = (x^5)^(1/12) = sqrt(sqrt(cbrt(x^5))).
double srgb_to_linear(double coded) noexcept {
  if (coded <= 0.04045) return coded / 12.92;
  const double x = (coded + 0.055) / 1.055;
  return x * x * root(x * x, 5);
}

double linear_to_srgb(double linear) noexcept {
  if (linear <= 0.0031308) return linear * 12.92;
  const double x5 = linear * linear * linear * linear * linear;
  return 1.055 * std::sqrt(std::sqrt(root(x5, 3))) - 0.055;
}

}  // namespace pounce
