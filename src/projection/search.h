// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "projection/hit_packet.h"

namespace pounce::projection {

/// The texels of one piece of the target and what they have found so far.
struct SearchState {
  PageVector<TexelPacket> packets;
  PageVector<HitPacket> hits;  ///< one per packet
  std::vector<target::PacketGroup> groups;
  std::vector<std::uint32_t> open;  ///< indices of the groups that still search

  static std::uint64_t most_bytes(std::uint64_t packets) {
    return round_to_pages(packets * sizeof(TexelPacket)) +
           round_to_pages(packets * sizeof(HitPacket)) +
           packets * (sizeof(target::PacketGroup) + sizeof(std::uint32_t));
  }
};

/// Search heights: the first, doubling up to the last, which is `max_distance`.
std::vector<float> search_heights(float max_distance);

/// The swept boxes of the open groups at a height, united per block of the piece; empty boxes for
/// blocks without open groups.
std::vector<Box3f> open_boxes(const SearchState& state, std::size_t blocks, float height,
                              const Kernels& kernels);

/// Tries every patch in `grid` on every open group that it may meet at this height.
void search_batch(const grid::PatchGrid& grid, float height, const SearchLimits& limits,
                  const Kernels& kernels, SearchState& state);

/// Closes the groups that nothing beyond `height` can improve.
void close_groups(float height, const Kernels& kernels, SearchState& state);

}  // namespace pounce::projection
