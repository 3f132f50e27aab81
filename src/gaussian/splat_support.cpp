// SPDX-License-Identifier: Apache-2.0
#include "gaussian/splat_support.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace pounce::gaussian {
namespace {

constexpr std::size_t kAround = 32;  // neighbours in the order, each way
constexpr std::size_t kLeastBlock = 17;
constexpr std::size_t kNth = 8;  // the usual spacing: as far as the 8th of them is
constexpr std::size_t kProbeEvery = 16;
constexpr int kEnough = 4;
constexpr float kAlone = 1.0F / 64;

/// Means of a block in arrays, so that loops over neighbours become vector code.
struct Means {
  std::vector<float> x, y, z;

  explicit Means(std::span<const store::Splat> block) {
    for (std::vector<float>* axis : {&x, &y, &z}) axis->reserve(block.size());
    for (const store::Splat& s : block) {
      x.push_back(s.mean.x);
      y.push_back(s.mean.y);
      z.push_back(s.mean.z);
    }
  }
  float squared(std::size_t i, std::size_t j) const {
    const float dx = x[j] - x[i], dy = y[j] - y[i], dz = z[j] - z[i];
    return dx * dx + dy * dy + dz * dz;
  }
  std::size_t first(std::size_t i) const { return i - std::min(i, kAround); }
  std::size_t last(std::size_t i) const { return std::min(i + kAround + 1, x.size()); }
};

float usual_spacing(const Means& means) {
  std::vector<float> figures, near;
  for (std::size_t i = 0; i < means.x.size(); i += kProbeEvery) {
    near.clear();
    for (std::size_t j = means.first(i); j < means.last(i); ++j)
      near.push_back(means.squared(i, j));
    const auto nth = near.begin() + kNth;  // the nearest is itself
    std::nth_element(near.begin(), nth, near.end());
    figures.push_back(*nth);
  }
  const auto middle = figures.begin() + static_cast<std::ptrdiff_t>(figures.size() / 2);
  std::nth_element(figures.begin(), middle, figures.end());
  return std::sqrt(*middle);
}

int count_within(const Means& means, std::size_t i, float squared) {
  const float x = means.x[i], y = means.y[i], z = means.z[i];
  std::int32_t count = -1;  // itself
  for (std::size_t j = means.first(i); j < means.last(i); ++j) {
    const float dx = means.x[j] - x, dy = means.y[j] - y, dz = means.z[j] - z;
    count += dx * dx + dy * dy + dz * dz < squared ? 1 : 0;
  }
  return count;
}

}  // namespace

void fade_isolated(std::span<store::Splat> block) {
  if (block.size() < kLeastBlock) return;
  const Means means(block);
  const float spacing = usual_spacing(means);
  for (std::size_t i = 0; i < block.size(); ++i) {
    const float reach = spacing + store::size_of(block[i]);
    const int count = count_within(means, i, reach * reach);
    if (count >= kEnough) continue;
    block[i].alpha *= count > 0 ? static_cast<float>(count) / kEnough : kAlone;
    store::round_for_store(block[i]);
  }
}

}  // namespace pounce::gaussian
