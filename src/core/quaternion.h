// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/vec.h"

namespace pounce {

/// Rotations as unit quaternions w, x, y, z, the order in which Gaussians store them. A rotation's
/// columns are where it puts the axes: of a Gaussian, the axes of its ellipsoid.

template <class T>
std::array<Vec3<T>, 3> rotation_columns(T w, T x, T y, T z) {
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
           {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
           {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}}};
}

/// The inverse, for columns of a proper rotation. q and -q are the same rotation; which of the two
/// comes out depends on the matrix. Four times the square of each component is on the diagonal;
/// the largest is taken from there and the others divided by it, so that none loses its digits.
inline std::array<double, 4> quaternion_of(const std::array<Vec3d, 3>& columns) {
  const auto& [a, b, c] = columns;
  const std::array<double, 4> squares{1 + a.x + b.y + c.z, 1 + a.x - b.y - c.z, 1 - a.x + b.y - c.z,
                                      1 - a.x - b.y + c.z};
  const auto largest =
      static_cast<std::size_t>(std::max_element(squares.begin(), squares.end()) - squares.begin());
  const double wx = b.z - c.y, wy = c.x - a.z, wz = a.y - b.x;
  const double xy = a.y + b.x, xz = c.x + a.z, yz = b.z + c.y;
  const std::array<std::array<double, 4>, 4> rows{{{squares[0], wx, wy, wz},
                                                   {wx, squares[1], xy, xz},
                                                   {wy, xy, squares[2], yz},
                                                   {wz, xz, yz, squares[3]}}};
  std::array<double, 4> q = rows[largest];
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& v : q) v /= norm;
  return q;
}

}  // namespace pounce
