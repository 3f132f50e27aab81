// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "pounce/report.h"
#include "projection/splat_packet.h"

namespace pounce::projection {

/// The texels of one piece of the target and what Gaussians gave them.
struct SplatState {
  PageVector<TexelPacket> packets;
  PageVector<RayBundle> bundles;       ///< one per packet, footprints included
  PageVector<float> reaches;           ///< how far along its rays a packet looks at this height
  PageVector<DepthPacket> depths;      ///< one per packet
  PageVector<ProfilePacket> profiles;  ///< one per packet
  std::vector<target::PacketGroup> groups;
  std::vector<std::uint32_t> open;  ///< indices of the groups that still search
  int height = 0;                   ///< how often the bins' width has doubled

  static std::uint64_t most_bytes(std::uint64_t packets) {
    return round_to_pages(packets * sizeof(TexelPacket)) +
           round_to_pages(packets * sizeof(RayBundle)) +
           round_to_pages(packets * sizeof(DepthPacket)) +
           round_to_pages(packets * sizeof(ProfilePacket)) +
           round_to_pages(packets * sizeof(float)) +
           packets * (sizeof(target::PacketGroup) + sizeof(std::uint32_t));
  }
  /// What blending holds beside the state and the sets, for so many Gaussians in a batch.
  static std::uint64_t scratch_bytes(std::uint64_t splats);
};

/// Prepares the search of state.packets and state.groups: all open, at the first height.
void start(const SplatLimits& limits, SplatState& state);

/// What the open groups may meet at this height, united per block of the piece; empty boxes for
/// blocks without open groups.
std::vector<Box3f> open_boxes(const SplatState& state, std::size_t blocks);

using SplatSets = std::span<const source::SplatSet* const>;

/// One height of the search where `sets` hold every Gaussian that open_boxes() meet.
void blend_height(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                  SplatState& state);

/// The same in parts, for Gaussians that come batch by batch: every batch into the profiles, then
/// the centres, then every batch into the sums.
void profile_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                   SplatState& state);
void find_centres(const SplatLimits& limits, SplatState& state);
void sum_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
               SplatState& state);

/// Closes groups that have nothing left to find; the others look twice as far from here on.
void next_height(const SplatLimits& limits, SplatState& state);

/// The colour of a texel, each channel clamped to 0..1; nothing if no Gaussian contributed.
std::optional<std::array<double, 3>> splat_colour(const DepthPacket& depths, int lane);

/// Adds how far away the coloured texels found their surface: the centre of the depth window.
void count_distances(const SplatState& state, float max_distance, DistanceCounts& counts);

}  // namespace pounce::projection
