// SPDX-License-Identifier: Apache-2.0
//
// Spherical harmonics from their definition: associated Legendre functions, double precision.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "core/vec.h"

namespace pounce::test {

/// Degrees 0 to 3 at a unit direction, l by l and m from -l to l, with the Condon-Shortley phase,
/// as 3DGS has them.
inline std::array<double, 16> slow_basis(const Vec3d& d) {
  std::array<double, 16> basis{};
  std::size_t at = 0;
  const double phi = std::atan2(d.y, d.x);
  for (int l = 0; l <= 3; ++l) {
    for (int m = -l; m <= l; ++m) {
      const int order = std::abs(m);
      double factorials = 1;  // (l - |m|)! / (l + |m|)!
      for (int k = l - order + 1; k <= l + order; ++k) factorials /= k;
      const double norm = std::sqrt((2 * l + 1) / (4 * std::numbers::pi) * factorials);
      const double phase = order % 2 == 0 ? 1 : -1;
      const double legendre =
          phase * std::assoc_legendre(static_cast<unsigned>(l), static_cast<unsigned>(order), d.z);
      const double around = m == 0  ? 1
                            : m > 0 ? std::numbers::sqrt2 * std::cos(order * phi)
                                    : std::numbers::sqrt2 * std::sin(order * phi);
      basis[at++] = norm * legendre * around;
    }
  }
  return basis;
}

/// Unit directions of the hemisphere around `axis`, as dense as the cosine to it is large.
template <class Visit>
void for_hemisphere(const Vec3d& axis, int count, const Visit& visit) {
  const Vec3d other = std::abs(axis.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  Vec3d u = cross(axis, other);
  u = u * (1 / length(u));
  const Vec3d v = cross(axis, u);
  for (int i = 0; i < count; ++i) {  // a spiral over the disc below the hemisphere
    const double r2 = (i + 0.5) / count, turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
    visit(u * (std::sqrt(r2) * std::cos(turn)) + v * (std::sqrt(r2) * std::sin(turn)) +
          axis * std::sqrt(1 - r2));
  }
}

}  // namespace pounce::test
