// SPDX-License-Identifier: Apache-2.0
//
// Search outward: which Gaussian does each target texel see first, along its normal, both ways?
//
// The answer is defined without any search: of all facets that face the texel, lie within the
// maximum distance and are hit (or missed by no more than their tolerance), the one with the least
// (key, triangle), where key =
// (|t| + distance outside) / texel. Heights only save work: at height h every facet with |t| <= h
// is met, and one beyond has a key above h / texel. So a texel whose key is below that is final,
// and the result does not depend on the heights, the order of the batches, the grid or the maximum
// distance (where something is in reach). It ends because the last height is the maximum distance.
//
// A minimum over (key, triangle) is associative, commutative and idempotent: source blocks may come
// in any order and any number of times, which is what lets the source be streamed past the texels.
#include "projection/search.h"

#include <array>
#include <cmath>

namespace pounce::projection {
namespace {

constexpr int kHeights = 7;  // the first is max_distance / 64

/// Rounding on the way from a texel to a hit, relative to the coordinates' size.
Box3f rounded_out(const Box3f& box) {
  const float largest = std::max({std::abs(box.lo.x), std::abs(box.lo.y), std::abs(box.lo.z),
                                  std::abs(box.hi.x), std::abs(box.hi.y), std::abs(box.hi.z)});
  return box.grown(4e-7F * largest);
}

}  // namespace

std::vector<float> search_heights(float max_distance) {
  std::vector<float> heights;
  for (int k = kHeights - 1; k >= 0; --k) heights.push_back(std::ldexp(max_distance, -k));
  return heights;
}

std::vector<Box3f> open_boxes(const SearchState& state, std::size_t blocks, float height,
                              const Kernels& kernels) {
  std::vector<Box3f> boxes(blocks);
  for (const std::uint32_t g : state.open) {
    const target::PacketGroup& group = state.groups[g];
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      boxes[state.packets[p].block].extend(
          rounded_out(kernels.swept_box(state.packets[p], height)));
    }
  }
  return boxes;
}

void search_batch(const grid::PatchGrid& grid, float height, const SearchLimits& limits,
                  const Kernels& kernels, SearchState& state) {
  std::vector<const grid::GridItem*> candidates;
  std::vector<Box3f> boxes;
  for (const std::uint32_t g : state.open) {
    const target::PacketGroup& group = state.groups[g];
    boxes.clear();
    Box3f all;
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      boxes.push_back(rounded_out(kernels.swept_box(state.packets[p], height)));
      all.extend(boxes.back());
    }
    candidates.clear();
    grid.query(all, [&](const grid::GridItem& item) { candidates.push_back(&item); });
    for (std::uint32_t i = 0; i < group.count; ++i) {
      const TexelPacket& packet = state.packets[group.first + i];
      HitPacket& best = state.hits[group.first + i];
      for (const grid::GridItem* item : candidates) {
        if (item->box.overlaps(boxes[i])) kernels.hit(*item->facet, packet, limits, best);
      }
    }
  }
}

void close_groups(float height, const Kernels& kernels, SearchState& state) {
  std::erase_if(state.open, [&](std::uint32_t g) {
    const target::PacketGroup& group = state.groups[g];
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      if (!kernels.all_final(state.packets[p], state.hits[p], height)) return false;
    }
    return true;
  });
}

}  // namespace pounce::projection
