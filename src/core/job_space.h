// SPDX-License-Identifier: Apache-2.0
//
// How positions of a file become those of the job: axes change places and signs, then an origin is
// subtracted.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/bounds.h"
#include "core/vec.h"

namespace pounce {

/// How a file's axes become those of the job: a signed permutation. Axis i of the result is
/// sign[i] times axis from[i] of the file; "x,-y,-z" turns by 180 degrees about x.
struct Axes {
  std::array<std::uint8_t, 3> from{0, 1, 2};  ///< each of 0, 1, 2 once
  std::array<std::int8_t, 3> sign{1, 1, 1};   ///< 1 or -1

  /// Positions, directions and normals alike; exact.
  template <class T>
  Vec3<T> apply(Vec3<T> v) const {
    const std::array<T, 3> old{v.x, v.y, v.z};
    const auto axis = [&](std::size_t i) { return sign[i] < 0 ? -old[from[i]] : old[from[i]]; };
    return {axis(0), axis(1), axis(2)};
  }
  /// The other way round.
  template <class T>
  Vec3<T> undo(Vec3<T> v) const {
    const std::array<T, 3> now{v.x, v.y, v.z};
    std::array<T, 3> old{};
    for (std::size_t i = 0; i < 3; ++i) old[from[i]] = sign[i] < 0 ? -now[i] : now[i];
    return {old[0], old[1], old[2]};
  }
  /// An ellipsoid: standard deviations along the columns of the matrix of a unit quaternion w, x,
  /// y, z. Exact: P R P^T has the quaternion's vector part moved like a pseudovector, and its
  /// columns change places as the axes do.
  void apply(Vec3f& sigma, std::array<float, 4>& rotation) const;
  /// True for determinant -1: what was right-handed becomes left-handed, so triangles change their
  /// winding.
  bool mirrors() const;
  bool operator==(const Axes&) const = default;
};

/// Reads "x,-y,-z". Throws Error(usage) unless each of x, y, z occurs once.
Axes parse_axes(std::string_view text);
std::string to_text(const Axes& axes);  ///< the inverse

/// Where a job counts positions from, for a source in this box: what is subtracted from all
/// positions, in double precision, while they are read. Zero unless the box is so far away, for its
/// size, that single precision is too coarse there (docs/decisions/042-origin.md): scans at map
/// coordinates. A multiple of a power of two that is about the size of the box, so that
/// subtraction from single precision is exact.
Vec3d origin_for(const Box3f& box);

}  // namespace pounce
