// SPDX-License-Identifier: Apache-2.0
//
// What moving a place of a surface costs, as sums of squares.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/vec.h"

namespace pounce::meshing {

/// The sum of squared distances from planes, each with a weight.
struct Quadric {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, x = 0, y = 0, z = 0, one = 0, weight = 0;

  /// Of the plane where n p + d is 0.
  void add(Vec3d n, double d, double w) {
    xx += w * n.x * n.x, xy += w * n.x * n.y, xz += w * n.x * n.z;
    yy += w * n.y * n.y, yz += w * n.y * n.z, zz += w * n.z * n.z;
    x += w * n.x * d, y += w * n.y * d, z += w * n.z * d;
    one += w * d * d;
    weight += w;
  }
  void add(const Quadric& q) {
    xx += q.xx, xy += q.xy, xz += q.xz, yy += q.yy, yz += q.yz, zz += q.zz;
    x += q.x, y += q.y, z += q.z, one += q.one, weight += q.weight;
  }
  double at(Vec3d p) const {
    const double square = xx * p.x * p.x + yy * p.y * p.y + zz * p.z * p.z +
                          2 * (xy * p.x * p.y + xz * p.x * p.z + yz * p.y * p.z);
    return std::max(square + 2 * (x * p.x + y * p.y + z * p.z) + one, 0.0);
  }
};

/// How far a texture slides: the squared differences between the UVs that a wedge's triangles had
/// at a place, continued as planes, and those that are there now.
struct Slide {
  Quadric squares;
  std::array<Vec3d, 2> rise{};  ///< sums over triangles, of u and v
  std::array<double, 2> at_zero{};

  void add(const std::array<Vec3d, 3>& corners, const std::array<Vec2f, 3>& uvs) {
    const Vec3d b = corners[1] - corners[0], c = corners[2] - corners[0];
    const double bb = dot(b, b), cc = dot(c, c), bc = dot(b, c), det = bb * cc - bc * bc;
    constexpr double kSliver = 1e-6;
    if (!(det > kSliver * bb * cc)) return;
    const double area = std::sqrt(det) / 2;
    for (std::size_t k = 0; k < 2; ++k) {
      const auto value = [&](std::size_t corner) {
        return double{k == 0 ? uvs[corner].x : uvs[corner].y};
      };
      const double to_b = value(1) - value(0), to_c = value(2) - value(0);
      const Vec3d g = b * ((to_b * cc - to_c * bc) / det) + c * ((to_c * bb - to_b * bc) / det);
      const double zero = value(0) - dot(g, corners[0]);
      squares.add(g, zero, area);
      rise[k] = rise[k] + g * area;
      at_zero[k] += zero * area;
    }
  }
  void add(const Slide& other) {
    squares.add(other.squares);
    for (std::size_t k = 0; k < 2; ++k) {
      rise[k] = rise[k] + other.rise[k];
      at_zero[k] += other.at_zero[k];
    }
  }
  double at(Vec3d p, Vec2f uv) const {
    const double u = uv.x, v = uv.y;
    const double both = u * (dot(rise[0], p) + at_zero[0]) + v * (dot(rise[1], p) + at_zero[1]);
    // Each triangle has counted its weight twice, once for u and once for v.
    return std::max(squares.at(p) - 2 * both + (u * u + v * v) * squares.weight / 2, 0.0);
  }
};

}  // namespace pounce::meshing
