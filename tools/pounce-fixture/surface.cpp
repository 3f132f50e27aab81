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
  // With S = 1 / radii and f = 1 + the bumps, the surface is where |S p| - f(p / |p|) is zero, and
  // its normal is that function's gradient: S^2 p / |S p| less f's slope along the sphere.
  double factor = 1;
  Vec3d slope{};
  for (const Bump& bump : bumps_) {
    const Vec3d away = direction - bump.centre;
    const double value = bump.height * std::exp(-bump.sharpness * dot(away, away));
    factor += value;
    slope = slope + away * (-2 * bump.sharpness * value);
  }
  const Vec3d scaled{direction.x / radii_.x, direction.y / radii_.y, direction.z / radii_.z};
  const double size = length(scaled), radius = factor / size;
  const Vec3d steepest{scaled.x / radii_.x / size, scaled.y / radii_.y / size,
                       scaled.z / radii_.z / size};
  const Vec3d along = slope - direction * dot(slope, direction);
  return {direction * radius, normalized(steepest - along * (1 / radius))};
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
