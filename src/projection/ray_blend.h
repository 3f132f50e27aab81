// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/page_pool.h"
#include "pounce/report.h"
#include "projection/splat_blend.h"

namespace pounce::projection {

/// The texels of one piece of the target and what they have met of a mesh's texels.
struct RayState {
  PageVector<TexelPacket> packets;
  PageVector<RayBundle> bundles;  ///< one per packet
  PageVector<RayPacket> sums;     ///< one per packet
  std::vector<surface::PacketGroup> groups;
  std::vector<std::uint32_t> open;  ///< indices of the groups that still search
  float reach = 0;                  ///< how far they look

  static std::uint64_t most_bytes(std::uint64_t packets) {
    return round_to_pages(packets * sizeof(TexelPacket)) +
           round_to_pages(packets * sizeof(RayBundle)) +
           round_to_pages(packets * sizeof(RayPacket)) +
           packets * (sizeof(surface::PacketGroup) + sizeof(std::uint32_t));
  }
  /// What adding holds beside the state and the sets, for so many Gaussians in a batch.
  static std::uint64_t scratch_bytes(std::uint64_t splats);
};

/// Prepares the search of state.packets and state.groups: all open, at the first reach.
void start(const RayLimits& limits, RayState& state);

/// What the open groups may meet within their reach, united per block of the piece; empty boxes for
/// blocks without open groups.
std::vector<Box3f> open_boxes(const RayState& state, std::size_t blocks);

/// Adds a batch of what open_boxes() meet. Every Gaussian comes once, in any order and any batches.
void add_batch(SplatSets sets, const RayLimits& limits, const SplatKernels& kernels,
               RayState& state, const GoOn& go_on);

/// Once all have come: texels that met any have their colour, the others look twice as far, to the
/// maximum distance; groups that have nothing left to find are closed.
void widen(const RayLimits& limits, RayState& state);

/// Colour and alpha of a texel; nothing if its ray met no Gaussian.
std::optional<std::array<double, 4>> ray_colour(const RayPacket& sums, int lane);

/// Adds how far away the coloured texels met theirs: the mean by weight.
void count_distances(const RayState& state, float max_distance, DistanceCounts& counts);

}  // namespace pounce::projection
