// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "core/box.h"

namespace pounce {

/// A cone around a bundle of rays: every point p + t n of theirs lies within offset + |t| spread of
/// origin + t direction.
struct RayBundle {
  Vec3f origin, direction;  ///< direction is a unit vector, or zero where normals cancel out
  float offset = 0, spread = 0;

  /// Holds every p + t n with |t| <= height.
  Box3f swept_box(float height) const {
    const float reach = offset + height * spread;
    const Vec3f d{std::abs(direction.x) * height + reach, std::abs(direction.y) * height + reach,
                  std::abs(direction.z) * height + reach};
    return {origin - d, origin + d};
  }

  /// False only if no ray, |t| <= height, meets the sphere.
  bool may_meet(Vec3f centre, float radius, float height) const {
    const float reach = (radius + offset + height * spread) * 1.00001F;
    const Vec3f v = centre - origin;
    const Vec3f across = cross(v, direction);
    // A zero direction has reach >= height: then only the distance to the origin counts, and it
    // passes.
    return dot(across, across) <= reach * reach && std::abs(dot(v, direction)) <= height + reach;
  }
};

}  // namespace pounce
