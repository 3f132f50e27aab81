// SPDX-License-Identifier: Apache-2.0
#include "gaussian/splat_shapes.h"

#include <algorithm>
#include <vector>

#include "gaussian/splat_noise.h"

namespace pounce::gaussian {

namespace {

/// The second largest standard deviation.
float middle_of(const store::Splat& s) {
  return std::max(std::min(s.sigma.x, s.sigma.y),
                  std::min(std::max(s.sigma.x, s.sigma.y), s.sigma.z));
}

/// 0 up to `none`, 1 from `all` on, smoothly between.
float smooth_step(float value, float none, float all) {
  const float x = std::clamp((value - none) / (all - none), 0.0F, 1.0F);
  return x * x * (3 - 2 * x);
}

}  // namespace

float median_roundness(std::span<const store::Splat> splats) {
  if (splats.empty()) return 1;
  std::vector<float> figures;
  figures.reserve(splats.size());
  for (const store::Splat& s : splats) figures.push_back(middle_of(s) / store::size_of(s));
  return median(figures);
}

float quartile_thickness(std::span<const store::Splat> splats) {
  std::vector<float> figures;
  figures.reserve(splats.size());
  for (const store::Splat& s : splats) {
    const float middle = middle_of(s), least = std::min({s.sigma.x, s.sigma.y, s.sigma.z});
    figures.push_back(middle > 0 ? least / middle : 0);
  }
  if (figures.empty()) return 0;
  const auto at = figures.begin() + static_cast<std::ptrdiff_t>(figures.size() / 4);
  std::nth_element(figures.begin(), at, figures.end());
  return *at;
}

float median_size(std::span<const store::Splat> splats) {
  std::vector<float> figures;
  figures.reserve(splats.size());
  for (const store::Splat& s : splats) figures.push_back(store::size_of(s));
  return median(figures);
}

float fine_edge(float size) { return kFineSizes * size; }

float discness(float roundness, float thickness) {
  constexpr float kNeedles = 0.45F, kRound = 0.7F;  // of roundness
  constexpr float kThin = 0.25F, kThick = 0.45F;    // of thickness
  return smooth_step(roundness, kNeedles, kRound) * (1 - smooth_step(thickness, kThin, kThick));
}

}  // namespace pounce::gaussian
