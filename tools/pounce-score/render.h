// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "points.h"
#include "scene.h"

namespace pounce::score {

/// What an orthographic viewer sees where a point would be drawn.
struct Pixel {
  Vec3d colour;             ///< of what is there, without the background
  double opacity = 0;       ///< of all of it
  double median_depth = 0;  ///< where half of the light is taken; beyond everything if it is not
};

/// Draws the scene along `direction` at the points, as its trainer's rasteriser would: ellipses
/// grown by 0.3 pixel^2, sorted by the depth of their means, front to back; nothing below 1/255 or
/// beyond 3 standard deviations. Double precision. `depths` of the points along the direction.
std::vector<Pixel> render(const Scene& scene, std::span<const Point> points, Vec3d direction,
                          double pixel, bool harmonics);

/// What a Gaussian gives to the ray through a point along its normal.
struct Hit {
  double t = 0;      ///< depth of the best hit, positive outside
  double alpha = 0;  ///< opacity x response, with the point's own footprint
  std::uint32_t gaussian = 0;
};

/// All hits with -below <= t <= above and more than 1/255 / 16 of an opaque Gaussian, per point.
std::vector<std::vector<Hit>> hits(const Scene& scene, std::span<const Point> points, double above,
                                   double below);

/// Front-to-back compositing of a point's hits, the outermost first; grey where there is nothing.
Vec3d composite(const Scene& scene, std::vector<Hit> hits);

}  // namespace pounce::score
