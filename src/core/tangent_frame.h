// SPDX-License-Identifier: Apache-2.0
//
// The frame that a normal map's vectors are in at a point of a surface, as renderers build it.
#pragma once

#include <cmath>

#include "core/vec.h"

namespace pounce {

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

}  // namespace pounce
