// SPDX-License-Identifier: Apache-2.0
//
// Where texels met what they took: what a normal map, a bake and colours of vertices need of the
// source's surface beyond the place in its image.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/directions.h"
#include "core/page_pool.h"
#include "projection/search.h"
#include "surface/source_block.h"

namespace pounce::projection {

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
