// SPDX-License-Identifier: Apache-2.0
#include "surface.h"

#include <cmath>
#include <utility>

namespace pounce::fixture {

HeadSurface::HeadSurface(Vec3d radii, std::vector<Bump> bumps)
    : radii_(radii), bumps_(std::move(bumps)) {
  for (Bump& bump : bumps_) bump.centre = normalized(bump.centre);
}

double HeadSurface::radius(Vec3d direction) const {
  const Vec3d scaled{direction.x / radii_.x, direction.y / radii_.y, direction.z / radii_.z};
  double factor = 1;
  for (const Bump& bump : bumps_) {
    const Vec3d away = direction - bump.centre;
    factor += bump.height * std::exp(-bump.sharpness * dot(away, away));
  }
  return factor / length(scaled);
}

SurfacePoint HeadSurface::point(Vec3d direction) const {
  // Central differences along two tangents: with h = 1e-5 their error is below 1e-9, far under a
  // float.
  constexpr double h = 1e-5;
  const Vec3d helper = std::abs(direction.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0};
  const Vec3d right = normalized(cross(helper, direction));
  const Vec3d up = cross(direction, right);
  const auto slope = [&](Vec3d along) {
    return position(normalized(direction + along * h)) -
           position(normalized(direction - along * h));
  };
  return {position(direction), normalized(cross(slope(right), slope(up)))};
}

HeadSurface source_head() {
  return HeadSurface({0.78, 1.05, 0.92}, {{{0, -0.08, 1}, 0.15, 45},       // nose
                                          {{0, -0.75, 0.75}, 0.08, 12},    // chin
                                          {{0.34, 0.2, 0.9}, -0.05, 45},   // eye sockets
                                          {{-0.34, 0.2, 0.9}, -0.05, 45},  //
                                          {{1, 0, -0.1}, 0.16, 40},        // ears
                                          {{-1, 0, -0.1}, 0.16, 40},       //
                                          {{0, 0.3, -1}, 0.10, 3},         // back of the head
                                          {{0, -1, -0.2}, 0.25, 5}});      // neck
}

HeadSurface other_head() {
  return HeadSurface({0.815, 1.02, 0.945}, {{{0, -0.11, 1}, 0.11, 38},
                                            {{0, -0.75, 0.75}, 0.06, 12},
                                            {{0.36, 0.2, 0.9}, -0.03, 45},
                                            {{-0.36, 0.2, 0.9}, -0.03, 45},
                                            {{1, 0.02, -0.12}, 0.13, 40},
                                            {{-1, 0.02, -0.12}, 0.13, 40},
                                            {{0, 0.3, -1}, 0.07, 3},
                                            {{0, -1, -0.2}, 0.22, 5}});
}

HeadSurface unit_sphere() { return HeadSurface({1, 1, 1}, {}); }

}  // namespace pounce::fixture
