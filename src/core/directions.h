// SPDX-License-Identifier: Apache-2.0
//
// Directions: how one is packed into four bytes, the frame that a normal map's vectors are in, and
// the functions on the sphere that a trained splat's colours are made of.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/vec.h"

namespace pounce {

/// A direction in two 16-bit numbers: the octahedron |x| + |y| + |z| = 1 seen from above, its lower
/// half unfolded around the upper. A direction comes back within 7e-5 radians.
using Octahedral = std::array<std::int16_t, 2>;
/// Stands for the zero vector.
inline constexpr Octahedral kNoDirection{-32768, -32768};

inline Octahedral to_octahedral(Vec3f n) {
  const float size = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
  if (!(size > 0) || !std::isfinite(size)) return kNoDirection;
  float u = n.x / size, v = n.y / size;
  if (n.z < 0) {
    const float folded = 1 - std::abs(v);
    v = std::copysign(1 - std::abs(u), v);
    u = std::copysign(folded, u);
  }
  const auto steps = [](float w) {
    return static_cast<std::int16_t>(std::floor(std::clamp(w, -1.0F, 1.0F) * 32767 + 0.5F));
  };
  return {steps(u), steps(v)};
}

/// A unit vector, or zero.
inline Vec3f from_octahedral(Octahedral o) {
  float u = static_cast<float>(o[0]) * (1.0F / 32767),
        v = static_cast<float>(o[1]) * (1.0F / 32767);
  const float z = 1 - std::abs(u) - std::abs(v);
  const float below = std::max(-z, 0.0F);  // how far to fold back
  u -= std::copysign(below, u);
  v -= std::copysign(below, v);
  const float scale = 1 / std::sqrt(u * u + v * v + z * z);
  return o == kNoDirection ? Vec3f{} : Vec3f{u * scale, v * scale, z * scale};
}

/// Normal and tangent as they come from between a triangle's corners, not of unit length, and
/// handedness. The third axis is handedness * cross(normal, tangent): along it v falls.
struct TangentFrame {
  Vec3d normal, tangent;
  double handedness = 1;

  Vec3d bitangent() const { return cross(normal, tangent) * (handedness < 0 ? -1.0 : 1.0); }
};

/// The unit vector along v; zero for zero.
inline Vec3d unit_vector(Vec3d v) {
  const double size = length(v);
  return size > 0 ? v * (1 / size) : v;
}

/// A frame that can be inverted: where the normal is zero or the tangent says nothing beside it,
/// some other takes its place.
inline TangentFrame usable(TangentFrame frame) {
  constexpr double kLeastSine = 1e-3;
  if (!(length(frame.normal) > 0)) frame.normal = {0, 0, 1};
  const double across = length(cross(frame.normal, frame.tangent));
  if (across > kLeastSine * length(frame.normal) * length(frame.tangent)) return frame;
  const Vec3d n = unit_vector(frame.normal);
  const Vec3d axis = std::abs(n.x) < 0.9 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  frame.tangent = unit_vector(axis - n * dot(axis, n));
  return frame;
}

/// From a normal map's vector to its direction in space, not of unit length. `frame` is usable.
inline Vec3d in_space(const TangentFrame& frame, Vec3d v) {
  return frame.tangent * v.x + frame.bitangent() * v.y + frame.normal * v.z;
}

/// The inverse: the unit vector that in_space() turns into this direction.
inline Vec3d in_frame(const TangentFrame& frame, Vec3d direction) {
  const Vec3d t = frame.tangent, b = frame.bitangent(), n = frame.normal;
  const Vec3d cofactors{dot(direction, cross(b, n)), dot(direction, cross(n, t)),
                        dot(direction, cross(t, b))};
  return unit_vector(cofactors * (dot(t, cross(b, n)) < 0 ? -1.0 : 1.0));
}

/// Turns v as the least turn from one unit vector to another does. Opposite ones leave it.
inline Vec3d turned(Vec3d v, Vec3d from, Vec3d to) {
  const double cosine = dot(from, to);
  if (!(cosine > -1)) return v;
  const Vec3d axis = cross(from, to);
  const Vec3d across = cross(axis, v);
  return v + across + cross(axis, across) * (1 / (1 + cosine));
}

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

// --- rotations -----------------------------------------------------------------------------------

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
