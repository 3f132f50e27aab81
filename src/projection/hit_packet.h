// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "grid/batch_patches.h"
#include "surface/target_block.h"

namespace pounce::projection {

using surface::kLanes;
using surface::TexelPacket;

inline constexpr std::int32_t kNoHit = std::numeric_limits<std::int32_t>::max();
/// A ray that runs more nearly in a facet's plane meets it as if it rose by this much per unit: a
/// point of the plane meets it where it is, whatever its normal.
inline constexpr float kGrazing = 1.0F / 64;

/// The best hit so far of sixteen texels: structure of arrays.
struct alignas(64) HitPacket {
  std::int32_t key[kLanes];                     ///< see key_of(); kNoHit = none
  std::int32_t id[kLanes];                      ///< triangle
  std::int32_t page[kLanes];                    ///< source page
  std::int32_t base_x[kLanes], base_y[kLanes];  ///< whole texels of the hit, not wrapped
  float frac_x[kLanes], frac_y[kLanes];         ///< the rest; may exceed 1: x = base_x + frac_x
  float x_by[3][kLanes], y_by[3][kLanes];       ///< how they change with the hit's position
};

/// What counts as a hit.
struct SearchLimits {
  float max_distance = 0;  ///< half-length of a texel's ray
  float min_cosine = 0;    ///< of the angle between the texel's normal and the surface's at the hit
};

/// The key of a packet's hits at `distance` = |t| + distance outside the triangle: the bits of a
/// float, which rise with it. Adding rounds it to the last place of the packet's coarseness where
/// it is smaller, to its own where it is larger: what single precision cannot tell apart here is a
/// tie.
inline std::int32_t key_of(float distance, const TexelPacket& packet) {
  return std::bit_cast<std::int32_t>(distance + packet.coarseness);
}
inline float distance_of(std::int32_t key, const TexelPacket& packet) {
  return std::bit_cast<float>(key) - packet.coarseness;
}

/// The kernels, one build per instruction set. All give the same bits: IEEE operations in one
/// order, no fused multiply-add, no approximate reciprocals. noexcept and thread-safe.
struct Kernels {
  const char* isa;  ///< "sse2", "avx2", "avx512"
  /// Tries a facet on all lanes and keeps the better hit of each.
  void (*hit)(const surface::Facet& facet, const TexelPacket& packet, const SearchLimits& limits,
              HitPacket& best);
  /// The patches that rays of the bundle may meet within `height`: at most as many as the list has,
  /// which may hold kMostListed. Returns how many there are, and their places in the list.
  std::size_t (*cull)(const grid::PatchSpheres& list, const RayBundle& bundle, float height,
                      std::uint16_t* places);
  /// Tries all candidates that the packet's rays may meet within `height`.
  void (*search)(const grid::PatchSpheres& candidates, const RayBundle& bundle, float height,
                 const TexelPacket& packet, const SearchLimits& limits, HitPacket& best);
  /// True when no facet farther away than `height` can beat what any lane has.
  bool (*all_final)(const TexelPacket& packet, const HitPacket& best, float height);
};

/// The kernels for `isa`, as instruction_set() chooses.
const Kernels& kernels(const std::string& isa);

/// No lane has a hit. All but key and id is left as it is.
void clear(HitPacket& best);

// --- bundles -------------------------------------------------------------------------------------

/// The bundle of a packet's used lanes.
RayBundle bundle_of(const surface::TexelPacket& packet);
/// A bundle that holds all of these (at least one).
RayBundle unite(std::span<const RayBundle> bundles);

}  // namespace pounce::projection
