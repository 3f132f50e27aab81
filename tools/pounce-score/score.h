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
  double behind =
      0;  ///< how far behind the point the scene lies, along its normal; of the diagonal
};

/// Of the diagonal: how far behind a point what is seen there may lie.
inline constexpr double kNearBehind = 0.02;

/// The truths of a scene at the points of a target.
struct Truth {
  std::vector<Sight> four;   ///< as seen along +-x and +-z, each point from each side that sees it
  std::vector<Sight> sides;  ///< the same from 14: the faces and corners of a cube
  std::vector<Sight> many;   ///< of 24 directions, weighed by the cosine, at points that 3 see
};

/// Draws the scene from all sides. A side sees a point that faces it by a cosine of 0.2 and lies
/// at most 2 % of the target's diagonal behind and `behind` before where half of the light is
/// taken.
Truth make_truth(const Scene& scene, const Points& points, bool harmonics,
                 double behind = kNearBehind);
/// Only where the scene lies more than that behind.
Truth beyond(const Truth& truth, double behind);

/// PSNR over all sights and channels, in dB: colours are clamped to 0..1.
double psnr(const std::vector<Sight>& truth, const std::vector<Vec3d>& colours);
/// Share of sights with a channel off by more than 0.15.
double share_off(const std::vector<Sight>& truth, const std::vector<Vec3d>& colours);

/// How well a number per texel tells which colours are wrong.
struct Ranking {
  std::size_t texels = 0;  ///< that have the number (above 0) and a truth of many views
  double wrong = 0;        ///< share of those with a channel off by more than 0.1
  double error = 0;        ///< mean over all of the channel that is most off
  double least_error = 0;  ///< the same over the tenth with the least numbers
  double area = 0.5;       ///< how often a wrong texel has a smaller number than a right one
};
Ranking rank(const Truth& truth, const std::vector<Vec3d>& colours,
             const std::vector<Vec3d>& numbers);

/// What plain compositing along the normals gives, begun `above` outside.
std::vector<Vec3d> composited(const Scene& scene, const Points& points, double above);

}  // namespace pounce::score
