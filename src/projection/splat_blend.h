// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "pounce/report.h"
#include "projection/splat_packet.h"
#include "surface/target_block.h"

namespace pounce::projection {

/// The angle between a texel's normal and its further rays is 35 degrees (docs/decisions/
/// 027-rays.md).
inline constexpr double kConeCosine = 0.81915204428899178968, kConeSine = 0.57357643635104609611;

/// The packet as it looks along further ray `k` of `count`: the same points, each with its normal
/// tilted by the cone's angle. The rays of a texel lie evenly around its normal. Lanes without a
/// normal stay without. 0 <= k < count. The same bits on every machine.
surface::TexelPacket tilted(const surface::TexelPacket& packet, int k, int count);

/// The texels of one piece of the target and what Gaussians gave them.
struct SplatState {
  PageVector<TexelPacket> packets;
  // One per packet, or with further rays a row of 1 + limits.rays: along the normals, then these.
  PageVector<RayBundle> bundles;
  PageVector<DepthPacket> depths;
  PageVector<ProfilePacket> profiles;  ///< only of Gaussians that come batch by batch
  std::vector<surface::PacketGroup> groups;

  /// With so many rays beside each texel's normal, but for the profiles.
  static std::uint64_t most_bytes(std::uint64_t packets, std::uint64_t rays) {
    const std::uint64_t looks = packets * (1 + rays);
    return round_to_pages(packets * sizeof(TexelPacket)) +
           round_to_pages(looks * sizeof(RayBundle)) + round_to_pages(looks * sizeof(DepthPacket)) +
           packets * sizeof(surface::PacketGroup);
  }
  static std::uint64_t profile_bytes(std::uint64_t packets, std::uint64_t rays) {
    return round_to_pages(packets * (1 + rays) * sizeof(ProfilePacket));
  }
  /// What blending holds beside the state and the sets, for so many Gaussians in a batch.
  static std::uint64_t scratch_bytes(std::uint64_t splats);
};

/// Prepares the search of state.packets and state.groups.
void start(const SplatLimits& limits, SplatState& state);

/// What the texels may meet, united per block of the piece.
std::vector<Box3f> reachable_boxes(const SplatLimits& limits, const SplatState& state,
                                   std::size_t blocks);

using SplatSets = std::span<const gaussian::SplatSet* const>;
/// Called for every packet, on the thread that blends: to end a blend, it throws.
using GoOn = std::function<void()>;

/// The whole search where `sets` hold every Gaussian that reachable_boxes() meet.
void blend_whole(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                 SplatState& state, const GoOn& go_on);

/// The same in parts, for Gaussians that come batch by batch: every batch into the profiles, then
/// the surfaces, then every batch into the sums.
void profile_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                   SplatState& state, const GoOn& go_on);
void find_surfaces(const SplatLimits& limits, const SplatKernels& kernels, SplatState& state);
void sum_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
               SplatState& state, const GoOn& go_on);

/// What a texel has found: along its normal, but for the colour.
struct SplatFinding {
  std::array<double, 3> colour;  ///< 0..1 each; the mean of all rays that found a surface
  double opacity = 0;   ///< 0..1: of the Gaussians along its normal, blurred, within the reach
  double distance = 0;  ///< of the surface from the texel, in space; positive outside
  /// 0..1: the opacity, less where colours along the normal differ or the surface lies far.
  double confidence = 0;
};

/// Of a packet, lane by lane: nothing where a texel has found less than limits.least_opacity or is
/// less sure than asked, nor in unused lanes.
struct SplatFindings {
  std::uint32_t found = 0;  ///< lanes that have something: a bit each
  double colour[3][kLanes], opacity[kLanes], distance[kLanes], confidence[kLanes];

  bool has(std::size_t lane) const { return (found >> lane & 1) != 0; }
  void drop(std::size_t lane) { found &= ~(std::uint32_t{1} << lane); }
  void take(std::size_t lane, const SplatFindings& from);  ///< what another has there
  std::optional<SplatFinding> operator[](std::size_t lane) const;
};
SplatFindings findings(const SplatLimits& limits, const SplatState& state, std::size_t packet);

// --- a mesh's texels on rays ---------------------------------------------------------------------

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
