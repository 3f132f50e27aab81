// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"

namespace pounce::score {

/// A texel of the target that is looked at.
struct Point {
  Vec3d position, normal;
  double edge = 0;  ///< of the texel on the surface
  std::uint32_t x = 0, y = 0;
};

struct Points {
  std::vector<Point> points;
  double diagonal = 0;  ///< of the covered texels' box
  std::uint32_t width = 0, height = 0;
};

/// Up to `most` texels taken evenly from the projection maps that `pounce maps` writes: a pattern
/// with <CHANNEL>. Throws pounce::Error.
Points read_points(const std::string& maps, std::size_t most);

/// An image's colours at the points, 0..1 as stored; black where it has fewer than three channels.
/// Throws pounce::Error, also where its size is not the points'.
std::vector<Vec3d> read_colours(const std::string& path, const Points& points);

/// Writes the points' colours as an image of the maps' size, and some texels around them, for
/// lookups between texels. Throws pounce::Error.
void write_texture(const std::string& path, const Points& points,
                   const std::vector<Vec3d>& colours);

}  // namespace pounce::score
