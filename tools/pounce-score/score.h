// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "points.h"
#include "scene.h"

namespace pounce::score {

/// What the points should show, seen from a side, and how much that says.
struct Sight {
  std::uint32_t point = 0;
  Vec3d colour;
};

/// The truths of a scene at the points of a target.
struct Truth {
  std::vector<Sight> four;   ///< as seen along +-x and +-z, each point from each side that sees it
  std::vector<Sight> sides;  ///< the same from 14: the faces and corners of a cube
  std::vector<Sight> many;   ///< of 24 directions, weighed by the cosine, at points that 3 see
};

/// Draws the scene from all sides. A side sees a point that faces it by a cosine of 0.2 and lies
/// within 2 % of the target's diagonal of where half of the light is taken.
Truth make_truth(const Scene& scene, const Points& points, bool harmonics);

/// PSNR over all sights and channels, in dB: colours are clamped to 0..1.
double psnr(const std::vector<Sight>& truth, const std::vector<Vec3d>& colours);
/// Share of sights with a channel off by more than 0.15.
double share_off(const std::vector<Sight>& truth, const std::vector<Vec3d>& colours);

/// What plain compositing along the normals gives, begun `above` outside.
std::vector<Vec3d> composited(const Scene& scene, const Points& points, double above);

}  // namespace pounce::score
