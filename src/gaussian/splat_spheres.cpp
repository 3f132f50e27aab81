// SPDX-License-Identifier: Apache-2.0
#include "gaussian/splat_spheres.h"

#include <algorithm>
#include <cmath>

#include "core/bounds.h"

namespace pounce::gaussian {
namespace {

/// Spheres around sixteen spheres each.
void make_level(const SplatSpheres& below, SplatSpheres& level) {
  resize(level, (below.count + kFanOut - 1) / kFanOut);
  for (std::size_t i = 0; i < level.count; ++i) {
    const std::size_t first = i * kFanOut, last = std::min(first + kFanOut, below.count);
    Box3f box;
    const auto centre = [&](std::size_t j) {
      return Vec3f{below.centre[0][j], below.centre[1][j], below.centre[2][j]};
    };
    for (std::size_t j = first; j < last; ++j) {
      const float r = below.radius[j];
      box.extend({centre(j) - Vec3f{r, r, r}, centre(j) + Vec3f{r, r, r}});
    }
    const Vec3f middle = (box.lo + box.hi) * 0.5F;
    float radius = 0;
    for (std::size_t j = first; j < last; ++j)
      radius = std::max(radius, length(centre(j) - middle) + below.radius[j]);
    level.centre[0][i] = middle.x;
    level.centre[1][i] = middle.y;
    level.centre[2][i] = middle.z;
    // Rounding of the centres counts, too, where the radius is small against the coordinates.
    level.radius[i] = radius * kSphereMargin + 4e-7F * (std::abs(middle.x) + std::abs(middle.y) +
                                                        std::abs(middle.z) + radius);
  }
}

}  // namespace

void resize(SplatSpheres& spheres, std::size_t count) {
  spheres.count = count;
  for (auto& axis : spheres.centre) axis.resize(whole_registers(count));
  spheres.radius.resize(whole_registers(count));
}

void make_levels(SplatTree& tree) {
  make_level(tree[0], tree[1]);
  make_level(tree[1], tree[2]);
}

std::uint64_t tree_bytes(std::uint64_t splats) {
  std::uint64_t bytes = 0;
  for (std::size_t level = 0; level < SplatTree{}.size(); ++level) {
    bytes += 4 * round_to_pages(whole_registers(splats) * sizeof(float));
    splats = (splats + kFanOut - 1) / kFanOut;
  }
  return bytes;
}

}  // namespace pounce::gaussian
