// SPDX-License-Identifier: Apache-2.0
//
// What kind of scene is this? The blend needs to know before it sees a single texel.
//
// A file of Gaussians does not state how it was trained, and the blend must treat two kinds apart:
// discs that lie in a surface, where the normal and the nearest layer mean something, and needles
// or balls that only form an image together, where they mean nothing. Shape tells: discs are round
// (second sigma near the first) and thin (third sigma far below the second). Both figures are taken
// over a sample of the scene, and discness() fades between the kinds, so that a scene in between
// has no edge to fall off. The limits come from the captures of decisions 023 and 038.
//
// Every figure is a median or a quartile, never a mean: one exploded Gaussian out of a million must
// not change how all the others are blended. They are order statistics of exact values, so neither
// the number of threads nor the order of the sample changes a bit.
//
// Neighbours are sought within a block alone. The store orders Gaussians along a curve and cuts
// where neighbours in that order are farthest apart; the few whose true neighbours ended up in the
// next block do not move a median, and no search structure over the scene is needed.
#include "gaussian/splat_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "core/directions.h"

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

constexpr std::size_t kNeighbours = 16;
constexpr std::size_t kMostPerBlock = 32;  // a search costs a pass over its block
constexpr float kDeviations = 1.4826F;     // of a normal distribution per median absolute deviation

/// The value of rank `n` from below; reorders.
float nth_of(std::vector<float>& figures, std::size_t n) {
  const auto at = figures.begin() + static_cast<std::ptrdiff_t>(n);
  std::nth_element(figures.begin(), at, figures.end());
  return *at;
}

/// Where the least of these are, but for number `self`; of equal ones the first. There are more.
std::array<std::size_t, kNeighbours> nearest(std::span<const float> squared, std::size_t self) {
  std::array<std::size_t, kNeighbours> found;
  std::size_t count = 0;
  const auto add = [&](std::size_t i) {
    std::size_t at = count < kNeighbours ? count++ : kNeighbours - 1;
    for (; at > 0 && squared[i] < squared[found[at - 1]]; --at) found[at] = found[at - 1];
    found[at] = i;
  };
  std::size_t i = 0;
  for (; count < kNeighbours; ++i) {
    if (i != self) add(i);
  }
  const auto add_near = [&](std::size_t end) {
    for (; i < end; ++i) {
      if (i != self && squared[i] < squared[found.back()]) add(i);
    }
  };
  constexpr std::size_t kAtOnce = 16;  // hardly any of which is nearer, as a rule
  while (i + kAtOnce <= squared.size()) {
    const float farthest = squared[found.back()];
    std::int32_t nearer = 0;
    for (std::size_t j = 0; j < kAtOnce; ++j) nearer += squared[i + j] < farthest ? 1 : 0;
    if (nearer > 0) {
      add_near(i + kAtOnce);
    } else {
      i += kAtOnce;
    }
  }
  add_near(squared.size());
  return found;
}

/// Mean of the two middle ones.
float middle(std::array<float, kNeighbours>& values) {
  std::sort(values.begin(), values.end());
  return (values[kNeighbours / 2 - 1] + values[kNeighbours / 2]) / 2;
}

/// The file's normal, else the shortest axis: that column of the quaternion's matrix. Its sign does
/// not matter here, since offsets along it are measured on both sides. A ball has no shortest axis;
/// any of them shows the noise of a cloud.
Vec3f normal_of(const store::Splat& s) {
  if (s.normal != Vec3f{}) return s.normal;
  const auto [w, x, y, z] = s.rotation;
  const auto axes = rotation_columns(w, x, y, z);
  if (s.sigma.x < s.sigma.y && s.sigma.x < s.sigma.z) return axes[0];
  return s.sigma.y < s.sigma.z ? axes[1] : axes[2];
}

constexpr std::size_t kAround = 32;  // neighbours in the order, each way
constexpr std::size_t kNext = 8;     // of those the ones that are near, as a rule
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
  std::size_t first(std::size_t i, std::size_t around) const { return i - std::min(i, around); }
  std::size_t last(std::size_t i, std::size_t around) const {
    return std::min(i + around + 1, x.size());
  }
};

/// The squared distance of the kNth-nearest in the order around it; itself is the zeroth.
float nth_squared(const Means& means, std::size_t i) {
  std::array<float, kNth + 1> least;
  least.fill(std::numeric_limits<float>::infinity());
  const auto add = [&](std::size_t j) {
    const float squared = means.squared(i, j);
    if (!(squared < least.back())) return;
    std::size_t at = kNth;
    for (; at > 0 && squared < least[at - 1]; --at) least[at] = least[at - 1];
    least[at] = squared;
  };
  add(i);
  // From the next one outwards: the near ones come first, and few are let in after them.
  for (std::size_t k = 1; k <= kAround; ++k) {
    if (i >= k) add(i - k);
    if (i + k < means.x.size()) add(i + k);
  }
  return least.back();
}

/// The median distance to the eighth neighbour, from every 16th Gaussian. The eighth and not the
/// first: pairs that training split off each other lie much closer than the surface is dense.
float usual_spacing(const Means& means) {
  std::vector<float> figures;
  for (std::size_t i = 0; i < means.x.size(); i += kProbeEvery)
    figures.push_back(nth_squared(means, i));
  return std::sqrt(median(figures));
}

/// How many of the Gaussians [first, last) lie within that distance of `i`, itself among them if it
/// is one of these.
int count_within(const Means& means, std::size_t i, std::size_t first, std::size_t last,
                 float squared) {
  const float x = means.x[i], y = means.y[i], z = means.z[i];
  std::int32_t count = 0;
  for (std::size_t j = first; j < last; ++j) {
    const float dx = means.x[j] - x, dy = means.y[j] - y, dz = means.z[j] - z;
    count += dx * dx + dy * dy + dz * dz < squared ? 1 : 0;
  }
  return count;
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
  return figures.empty() ? 0 : nth_of(figures, figures.size() / 4);
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

void append_surface_noise(const store::SplatBlock& block, std::vector<float>& figures) {
  const std::size_t count = block.size();
  if (count <= kNeighbours) return;
  const std::size_t probes = std::min(count, kMostPerBlock);
  std::vector<float> squared(count);
  for (std::size_t p = 0; p < probes; ++p) {
    const std::size_t at = p * count / probes;
    const store::Splat probe = block.splat(at);
    for (std::size_t i = 0; i < count; ++i) {
      const float dx = block.mean[0][i] - probe.mean.x, dy = block.mean[1][i] - probe.mean.y,
                  dz = block.mean[2][i] - probe.mean.z;
      squared[i] = dx * dx + dy * dy + dz * dz;
    }
    const Vec3f normal = normal_of(probe);
    std::array<float, kNeighbours> offsets;
    std::size_t k = 0;
    for (const std::size_t n : nearest(squared, at)) {
      offsets[k++] = dot(
          Vec3f{block.mean[0][n], block.mean[1][n], block.mean[2][n]} + probe.mean * -1.0F, normal);
    }
    // The probe itself may be the outlier: spread is measured about its neighbours' own middle.
    const float centre = middle(offsets);
    for (float& offset : offsets) offset = std::abs(offset - centre);
    figures.push_back(kDeviations * middle(offsets));
  }
}

float median(std::vector<float>& figures) {
  return figures.empty() ? 0 : nth_of(figures, figures.size() / 2);
}

void fade_isolated(std::span<store::Splat> block) {
  if (block.size() < kLeastBlock) return;
  const Means means(block);
  const float spacing = usual_spacing(means);
  for (std::size_t i = 0; i < block.size(); ++i) {
    // A large Gaussian may stand alone on a plain wall: its own size counts as neighbourhood.
    const float reach = spacing + store::size_of(block[i]);
    const auto within = [&](std::size_t around) {  // but for itself
      return count_within(means, i, means.first(i, around), means.last(i, around), reach * reach) -
             1;
    };
    if (within(kNext) >= kEnough) continue;
    const int count = within(kAround);
    if (count >= kEnough) continue;
    block[i].alpha *= count > 0 ? static_cast<float>(count) / kEnough : kAlone;
    // What is stored later must decode to exactly this, or a store would depend on who wrote it.
    store::round_for_store(block[i]);
  }
}

}  // namespace pounce::gaussian
