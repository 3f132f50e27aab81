// SPDX-License-Identifier: Apache-2.0
#include "gaussian/splat_noise.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace pounce::gaussian {
namespace {

constexpr std::size_t kNeighbours = 16;
constexpr std::size_t kMostPerBlock = 32;
constexpr float kDeviations = 1.4826F;  // of a normal distribution per median absolute deviation

/// Mean of the two middle ones.
float middle(std::array<float, kNeighbours>& values) {
  std::sort(values.begin(), values.end());
  return (values[kNeighbours / 2 - 1] + values[kNeighbours / 2]) / 2;
}

Vec3f normal_of(const store::Splat& s) {
  if (s.normal != Vec3f{}) return s.normal;
  const float w = s.rotation[0], x = s.rotation[1], y = s.rotation[2], z = s.rotation[3];
  if (s.sigma.x < s.sigma.y && s.sigma.x < s.sigma.z)
    return {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
  if (s.sigma.y < s.sigma.z)
    return {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
  return {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

}  // namespace

void append_surface_noise(const store::SplatBlock& block, std::vector<float>& figures) {
  const std::size_t count = block.size();
  if (count <= kNeighbours) return;
  const std::size_t probes = std::min(count, kMostPerBlock);
  std::vector<std::pair<float, std::uint32_t>> near(count);  // squared distance, index
  for (std::size_t p = 0; p < probes; ++p) {
    const std::size_t at = p * count / probes;
    const store::Splat probe = block.splat(at);
    for (std::size_t i = 0; i < count; ++i) {
      const float dx = block.mean[0][i] - probe.mean.x, dy = block.mean[1][i] - probe.mean.y,
                  dz = block.mean[2][i] - probe.mean.z;
      near[i] = {dx * dx + dy * dy + dz * dz, static_cast<std::uint32_t>(i)};
    }
    near[at].first = -1;  // itself: always the nearest
    std::nth_element(near.begin(), near.begin() + kNeighbours, near.end());
    const Vec3f normal = normal_of(probe);
    std::array<float, kNeighbours> offsets;
    std::size_t k = 0;
    for (std::size_t i = 0; i <= kNeighbours; ++i) {
      const std::uint32_t n = near[i].second;
      if (n == at) continue;
      offsets[k++] = dot(
          Vec3f{block.mean[0][n], block.mean[1][n], block.mean[2][n]} + probe.mean * -1.0F, normal);
    }
    const float centre = middle(offsets);
    for (float& offset : offsets) offset = std::abs(offset - centre);
    figures.push_back(kDeviations * middle(offsets));
  }
}

float median(std::vector<float>& figures) {
  if (figures.empty()) return 0;
  const auto at = figures.begin() + static_cast<std::ptrdiff_t>(figures.size() / 2);
  std::nth_element(figures.begin(), at, figures.end());
  return *at;
}

}  // namespace pounce::gaussian
