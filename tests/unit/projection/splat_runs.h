// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstring>
#include <vector>

#include "unit/projection/splat_packets.h"

namespace pounce::test {

/// Sets of at most `block` Gaussians each, in their order.
inline std::vector<gaussian::SplatSet> make_sets(const std::vector<ReferenceSplat>& scene,
                                                 std::size_t block) {
  std::vector<gaussian::SplatSet> sets;
  for (std::size_t i = 0; i < scene.size(); i += block) {
    const std::vector<ReferenceSplat> part(
        scene.begin() + static_cast<std::ptrdiff_t>(i),
        scene.begin() + static_cast<std::ptrdiff_t>(std::min(i + block, scene.size())));
    sets.push_back(gaussian::make_splat_set(splat_block(part)));
  }
  return sets;
}

inline std::vector<const gaussian::SplatSet*> pointers(
    const std::vector<gaussian::SplatSet>& sets) {
  std::vector<const gaussian::SplatSet*> out;
  for (const auto& set : sets) out.push_back(&set);
  return out;
}

inline void on() {}

inline void run_whole(const std::vector<gaussian::SplatSet>& sets,
                      const projection::SplatLimits& limits,
                      const projection::SplatKernels& kernels, projection::SplatState& state) {
  start(limits, state);
  blend_whole(pointers(sets), limits, kernels, state, on);
}

inline void run_batches(const std::vector<gaussian::SplatSet>& sets,
                        const projection::SplatLimits& limits,
                        const projection::SplatKernels& kernels, projection::SplatState& state) {
  const auto all = pointers(sets);
  start(limits, state);
  for (std::size_t i = 0; i < all.size(); ++i)
    profile_batch(std::span(all).subspan(i, 1), limits, kernels, state, on);
  find_surfaces(limits, kernels, state);
  for (std::size_t i = all.size(); i-- > 0;)
    sum_batch(std::span(all).subspan(i, 1), limits, kernels, state, on);
}

/// What two runs must agree in, to the bit.
inline bool same_sums(const projection::SplatState& a, const projection::SplatState& b) {
  for (std::size_t i = 0; i < a.depths.size(); ++i) {
    if (std::memcmp(a.depths[i].weight, b.depths[i].weight, sizeof a.depths[i].weight) != 0 ||
        std::memcmp(a.depths[i].colour, b.depths[i].colour, sizeof a.depths[i].colour) != 0) {
      return false;
    }
  }
  return a.depths.size() == b.depths.size();
}

}  // namespace pounce::test
