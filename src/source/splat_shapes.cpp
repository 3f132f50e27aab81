// SPDX-License-Identifier: Apache-2.0
#include "source/splat_shapes.h"

#include <algorithm>
#include <vector>

#include "source/splat_noise.h"

namespace pounce::source {

float median_roundness(std::span<const store::Splat> splats) {
  if (splats.empty()) return 1;
  std::vector<float> figures;
  figures.reserve(splats.size());
  for (const store::Splat& s : splats) {
    const float middle = std::max(std::min(s.sigma.x, s.sigma.y),
                                  std::min(std::max(s.sigma.x, s.sigma.y), s.sigma.z));
    figures.push_back(middle / store::size_of(s));
  }
  return median(figures);
}

float median_size(std::span<const store::Splat> splats) {
  std::vector<float> figures;
  figures.reserve(splats.size());
  for (const store::Splat& s : splats) figures.push_back(store::size_of(s));
  return median(figures);
}

float fine_edge(float size) {
  constexpr float kFineSizes = 1.75F;
  return kFineSizes * size;
}

float discness(float roundness) {
  constexpr float kNone = 0.45F, kAll = 0.7F;
  const float x = std::clamp((roundness - kNone) / (kAll - kNone), 0.0F, 1.0F);
  return x * x * (3 - 2 * x);
}

}  // namespace pounce::source
