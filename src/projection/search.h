// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/directions.h"
#include "core/page_pool.h"
#include "pounce/report.h"
#include "projection/hit_packet.h"
#include "surface/source_block.h"

namespace pounce::projection {

/// The texels of one piece of the target and what they have found so far.
struct SearchState {
  PageVector<TexelPacket> packets;
  UnsetPageVector<HitPacket> hits;  ///< one per packet; see start()
  PageVector<RayBundle> bundles;    ///< one per packet
  std::vector<surface::PacketGroup> groups;
  std::vector<std::uint32_t> open;  ///< indices of the groups that still search

  static std::uint64_t most_bytes(std::uint64_t packets) {
    return round_to_pages(packets * sizeof(TexelPacket)) +
           round_to_pages(packets * sizeof(HitPacket)) +
           round_to_pages(packets * sizeof(RayBundle)) +
           packets * (sizeof(surface::PacketGroup) + sizeof(std::uint32_t));
  }
};

/// Search heights: a short rising sequence that ends at `max_distance`. The result does not depend
/// on it.
std::vector<float> search_heights(float max_distance);

/// Prepares the search of state.packets and state.groups: no hits, all groups open. Where nothing
/// is hit, only key and id will have a value.
void start(SearchState& state);

/// The swept boxes of the open groups at a height, united per block of the piece; empty boxes for
/// blocks without open groups.
std::vector<Box3f> open_boxes(const SearchState& state, std::size_t blocks, float height);

/// Tries every patch of the batch on every open group that it may meet at this height.
void search_batch(grid::BatchPatches& patches, float height, const SearchLimits& limits,
                  const Kernels& kernels, SearchState& state);

/// Closes the groups that nothing beyond `height` can improve.
void close_groups(float height, const Kernels& kernels, SearchState& state);

/// The first of the heights within which half of the texels found what they found: a good first one
/// for their neighbours, too. By index; 0 if none found anything.
std::size_t middle_height(const SearchState& state, std::span<const float> heights);

/// Adds how far away the texels found what they found. Returns the sum of their distance_steps().
std::uint64_t count_distances(float max_distance, const SearchState& state, DistanceCounts& counts);

/// 0 to `most`, and 0 for what is no number: by values, which loops over lanes become vectors with.
inline float kept_in(float value, float most) {
  const float above = value > 0 ? value : 0.0F;
  return above < most ? above : most;
}
/// The bin of a distance that is such a share of the most.
inline std::int32_t distance_bin(float share) {
  constexpr auto kLast = static_cast<float>(kDistanceBins - 1);
  return static_cast<std::int32_t>(kept_in(share * static_cast<float>(kDistanceBins), kLast));
}
/// The same share in steps of 2^-16.
inline std::int32_t share_steps(float share) {
  constexpr float kSteps = 65536;
  return static_cast<std::int32_t>(kept_in(share, 1) * kSteps + 0.5F);
}

/// Counts a texel that found its surface at `distance`, of at most `max_distance`. Integers, so the
/// sums do not depend on order.
inline void count_distance(float distance, float max_distance, DistanceCounts& counts) {
  ++counts[static_cast<std::size_t>(distance_bin(distance / max_distance))];
}

/// The same distance in steps of max_distance / 2^16, of which sums do not depend on order, either.
inline std::uint64_t distance_steps(float distance, float max_distance) {
  return static_cast<std::uint64_t>(share_steps(distance / max_distance));
}

// --- the surface that was hit --------------------------------------------------------------------
//
// Where texels met what they took: what a normal map, a bake and colours of vertices need of the
// source's surface beyond the place in its image.

/// The surface where sixteen texels hit it: structure of arrays.
struct alignas(64) SurfacePacket {
  std::int32_t id[kLanes];                   ///< of the facet these are of; kNoHit: none yet
  float px[kLanes], py[kLanes], pz[kLanes];  ///< the point of the facet
  float height[kLanes];                      ///< of it over the texel, along the texel's normal
  float nx[kLanes], ny[kLanes], nz[kLanes];  ///< normal, between the facet's corners
  float tx[kLanes], ty[kLanes], tz[kLanes];  ///< tangent, the same
  float handedness[kLanes];
  float red[kLanes], green[kLanes], blue[kLanes];  ///< of the vertices: linear light; white if none
  float alpha[kLanes];

  std::array<double, 4> colour(int lane) const {
    return {red[lane], green[lane], blue[lane], alpha[lane]};
  }
  Vec3d position(int lane) const { return {px[lane], py[lane], pz[lane]}; }
  TangentFrame frame(int lane) const {
    return {{nx[lane], ny[lane], nz[lane]}, {tx[lane], ty[lane], tz[lane]}, handedness[lane]};
  }
};

/// The surface points of a search. Each is a function of its texel and its winner alone, so batches
/// may be cut anywhere.
class SurfacePoints {
 public:
  /// One per packet of the search, empty.
  void start(std::size_t packets);
  /// For all texels whose winner came with this batch: to be called after each search_batch().
  /// Tangents and colours are those of blocks that have attributes. Winners that are found in none
  /// of these are left as they are.
  void follow(const SearchState& state,
              std::span<const std::shared_ptr<const surface::SourceBlock>> batch);
  const SurfacePacket& operator[](std::size_t packet) const { return packets_[packet]; }

  /// Bytes for so many packets and texels, what follow() needs included.
  static std::uint64_t most_bytes(std::uint64_t packets);

 private:
  PageVector<SurfacePacket> packets_;
};

}  // namespace pounce::projection
