// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace pounce::fixture {

/// A position with its outward unit normal.
struct SurfacePoint {
  Vec3d position, normal;
};

/// A closed head-like surface, y up, looking along +z, about two units high. It is star-shaped: the
/// point in unit direction d is r(d) d with one analytic r, so the direction of any point near it
/// is normalize(position), whatever the tessellation.
class HeadSurface {
 public:
  /// A smooth bulge (or dent) of r around a direction: height * exp(-sharpness |d - centre|^2).
  struct Bump {
    Vec3d centre;
    double height, sharpness;
  };
  HeadSurface(Vec3d radii, std::vector<Bump> bumps);

  double radius(Vec3d direction) const;  ///< `direction` is unit
  Vec3d position(Vec3d direction) const { return direction * radius(direction); }
  SurfacePoint point(Vec3d direction) const;

 private:
  Vec3d radii_;
  std::vector<Bump> bumps_;
};

/// The demo head, and another head: other proportions, the distance between the two is about 1 % of
/// the diagonal (median), at most 4 %.
HeadSurface source_head();
HeadSurface other_head();
/// The unit sphere.
HeadSurface unit_sphere();

/// Scales to length 1.
inline Vec3d normalized(Vec3d v) { return v * (1.0 / length(v)); }

}  // namespace pounce::fixture
