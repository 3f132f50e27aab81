// SPDX-License-Identifier: Apache-2.0
//
// Hits as an image: where on the source each texel's ray ended. docs/hit-map.md is for its readers.
#pragma once

#include <array>

#include "pounce/options.h"
#include "projection/hit_packet.h"
#include "projection/surface_points.h"

namespace pounce::projection {

/// What a map says of a texel, a float each, in this order.
inline constexpr std::array<const char*, 6> kHitMapNames{"R",    "G",        "A",
                                                         "udim", "distance", "angle"};
using HitMapTexel = std::array<float, kHitMapNames.size()>;

/// The texel of a lane that hit. `lattice`: the size that the hit's texel coordinates are on; 0 x 0
/// where the page has no image, and so no coordinates. `surface`: what SurfacePoints knows of it.
HitMapTexel map_texel(const HitPacket& hit, const TexelPacket& texels, const SurfacePacket& surface,
                      std::size_t lane, ImageSize lattice);

}  // namespace pounce::projection
