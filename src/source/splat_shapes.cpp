// SPDX-License-Identifier: Apache-2.0
#include "source/splat_shapes.h"

#include <algorithm>
#include <vector>

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
  const auto at = figures.begin() + static_cast<std::ptrdiff_t>(figures.size() / 2);
  std::nth_element(figures.begin(), at, figures.end());
  return *at;
}

float discness(float roundness) {
  constexpr float kNone = 0.45F, kAll = 0.7F;
  const float x = std::clamp((roundness - kNone) / (kAll - kNone), 0.0F, 1.0F);
  return x * x * (3 - 2 * x);
}

}  // namespace pounce::source
