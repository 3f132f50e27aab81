// SPDX-License-Identifier: Apache-2.0
//
// Colours of a target's texels as a scene shows them from all around: the plain form of the rule,
// in double precision and with everything in memory, that others are held against.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/mesh.h"
#include "points.h"
#include "scene.h"

namespace pounce::score {

struct AroundOptions {
  std::size_t views = 24;
  std::uint32_t size = 1024;  ///< pixels along a view's edge
  double exponent = 2;        ///< of the cosine, as a weight
  double least_cosine = 0.1;  ///< of a texel's normal with the way to the eye
  double on_target = 0.012;   ///< of the diagonal: so near the target's surface is the texel's
  double hidden = 0.04;       ///< of the diagonal: so far before the texel the scene hides it
  double least_alpha = 0.5;   ///< of the scene in a view
  bool harmonics = false;
  double sharpened = 0;  ///< how far each view's pixels move from what is around them
  double ring = 0.006;   ///< of the diagonal: as far away as that is
};

/// What the views that see a point show there.
struct AroundColour {
  Vec3d colour;
  double weight = 0;  ///< 0: no view sees it
};

std::vector<AroundColour> around(const Scene& scene, const mesh::Mesh& target, const Points& points,
                                 const AroundOptions& options);

/// The nearest Gaussian's colour at each point: the least that one would do.
std::vector<Vec3d> nearest_colours(const Scene& scene, const Points& points);

}  // namespace pounce::score
