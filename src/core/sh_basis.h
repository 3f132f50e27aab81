// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

namespace pounce {

inline constexpr double kShDegree0 = 0.28209479177387814;  ///< 1 / sqrt(4 pi)

/// Real spherical harmonics of degrees 0 to 3 in the order and with the signs of 3DGS, at a unit
/// direction. Orthonormal over the sphere. T is anything that multiplies with its own kind and with
/// S: double, float, a vector of floats.
template <class S, class T>
std::array<T, 16> sh_basis(T x, T y, T z) {
  const auto c = [](double value) { return static_cast<S>(value); };
  const T xx = x * x, yy = y * y, zz = z * z;
  const T one = xx * c(0) + c(1);
  return {one * c(kShDegree0),
          y * c(-0.4886025119029199),
          z * c(0.4886025119029199),
          x * c(-0.4886025119029199),
          x * y * c(1.0925484305920792),
          y * z * c(-1.0925484305920792),
          (zz * c(2) - xx - yy) * c(0.31539156525252005),
          x * z * c(-1.0925484305920792),
          (xx - yy) * c(0.5462742152960396),
          y * (xx * c(3) - yy) * c(-0.5900435899266435),
          x * y * z * c(2.890611442640554),
          y * (zz * c(4) - xx - yy) * c(-0.4570457994644658),
          z * (zz * c(2) - xx * c(3) - yy * c(3)) * c(0.3731763325901154),
          x * (zz * c(4) - xx - yy) * c(-0.4570457994644658),
          z * (xx - yy) * c(1.445305721320277),
          x * (xx - yy * c(3)) * c(-0.5900435899266435)};
}

}  // namespace pounce
