// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/vec.h"

namespace pounce {

/// Axis-aligned rectangle, closed.
template <class T>
struct Box2 {
  Vec2<T> lo, hi;
};

template <class T>
Box2<T> box_of(const std::array<Vec2<T>, 3>& triangle) {
  const auto [x0, x1] = std::minmax({triangle[0].x, triangle[1].x, triangle[2].x});
  const auto [y0, y1] = std::minmax({triangle[0].y, triangle[1].y, triangle[2].y});
  return {{x0, y0}, {x1, y1}};
}

/// Axis-aligned box, closed; empty when made.
struct Box3f {
  Vec3f lo{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
           std::numeric_limits<float>::infinity()};
  Vec3f hi{-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
           -std::numeric_limits<float>::infinity()};

  bool empty() const { return !(lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z); }
  void extend(Vec3f p) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
  }
  void extend(const Box3f& b) {
    if (!b.empty()) {
      extend(b.lo);
      extend(b.hi);
    }
  }
  Box3f grown(float by) const {
    return {{lo.x - by, lo.y - by, lo.z - by}, {hi.x + by, hi.y + by, hi.z + by}};
  }
  bool overlaps(const Box3f& b) const {
    return lo.x <= b.hi.x && b.lo.x <= hi.x && lo.y <= b.hi.y && b.lo.y <= hi.y && lo.z <= b.hi.z &&
           b.lo.z <= hi.z;
  }
  bool operator==(const Box3f&) const = default;
};

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
