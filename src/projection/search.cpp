// SPDX-License-Identifier: Apache-2.0
//
// Search outward: which Gaussian does each target texel see first, along its normal, both ways?
//
// The answer is defined without any search: of all facets that are within the maximum distance, are
// hit (or missed by no more than their tolerance) and whose surface faces the texel there, the one
// with the least (key, triangle), where the key is |t| + distance outside, as single precision
// knows it. Heights only save work: at height h every facet with |t| <= h is met, and one beyond
// has at least the key of h. So a texel whose key is below that is final, and the result does not
// depend on the heights, the order of the batches, the grid or the maximum distance (where
// something is in reach). It ends because the last height is the maximum distance.
//
// A minimum over (key, triangle) is associative, commutative and idempotent: source blocks may come
// in any order and any number of times, which is what lets the source be streamed past the texels.
#include "projection/search.h"

#include <algorithm>
#include <cmath>

namespace pounce::projection {
namespace {

// The first is max_distance / 64; each next one is four times the last. Rays are culled against
// patches one by one, so reaching too far costs little, and every height costs a pass over the
// source's boxes.
constexpr int kHeights = 4;

}  // namespace

std::vector<float> search_heights(float max_distance) {
  std::vector<float> heights;
  for (int k = kHeights - 1; k >= 0; --k) heights.push_back(std::ldexp(max_distance, -2 * k));
  return heights;
}

void start(SearchState& state) {
  HitPacket none;
  clear(none);
  state.hits.assign(state.packets.size(), none);
  state.bundles.reserve(state.packets.size());
  for (const TexelPacket& packet : state.packets) state.bundles.push_back(bundle_of(packet));
  state.open.resize(state.groups.size());
  for (std::uint32_t g = 0; g < state.open.size(); ++g) state.open[g] = g;
}

std::vector<Box3f> open_boxes(const SearchState& state, std::size_t blocks, float height) {
  std::vector<Box3f> boxes(blocks);
  for (const std::uint32_t g : state.open) {
    const surface::PacketGroup& group = state.groups[g];
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      boxes[state.packets[p].block].extend(state.bundles[p].swept_box(height));
    }
  }
  return boxes;
}

void search_batch(grid::PatchGrid& grid, float height, const SearchLimits& limits,
                  const Kernels& kernels, SearchState& state) {
  Candidates candidates;
  for (const std::uint32_t g : state.open) {
    const surface::PacketGroup& group = state.groups[g];
    const std::span bundles(state.bundles.data() + group.first, group.count);
    const RayBundle all = unite(bundles);
    candidates.clear();
    grid.query(all, height, [&](const grid::GridItem& item) { candidates.add(item); });
    if (candidates.size() == 0) continue;
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      kernels.search(candidates, state.bundles[p], height, state.packets[p], limits, state.hits[p]);
    }
  }
}

float middle_distance(const SearchState& state) {
  std::vector<float> distances;
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    if (state.hits[p].key[0] == kNoHit) continue;
    distances.push_back(distance_of(state.hits[p].key[0], state.packets[p]));
  }
  if (distances.empty()) return 0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

std::uint64_t count_distances(float max_distance, const SearchState& state,
                              DistanceCounts& counts) {
  std::uint64_t steps = 0;
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const bool is_found =
          state.packets[p].texel[lane] != surface::kNoTexel && state.hits[p].key[lane] != kNoHit;
      if (!is_found) continue;
      const float distance = distance_of(state.hits[p].key[lane], state.packets[p]);
      count_distance(distance, max_distance, counts);
      steps += distance_steps(distance, max_distance);
    }
  }
  return steps;
}

void close_groups(float height, const Kernels& kernels, SearchState& state) {
  std::erase_if(state.open, [&](std::uint32_t g) {
    const surface::PacketGroup& group = state.groups[g];
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      if (!kernels.all_final(state.packets[p], state.hits[p], height)) return false;
    }
    return true;
  });
}

}  // namespace pounce::projection
