// SPDX-License-Identifier: Apache-2.0
//
// Hits as an image: where on the source each texel's ray ended. docs/hit-map.md is for its readers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "pounce/options.h"
#include "projection/hit_block.h"
#include "projection/hit_packet.h"
#include "projection/surface_points.h"
#include "surface/target_block.h"

namespace pounce::projection {

/// What a map says of a texel, a float each, in this order: first what people and compositors read,
/// then the hit itself, to the bit, as shading takes it.
inline constexpr std::array<const char*, 24> kHitMapNames{
    "R",         "G",          "A",        "udim",     "distance", "angle",   // for people
    "hit.page",  "hit.column", "hit.row",  "hit.fx",   "hit.fy",              // HitFacet, fractions
    "hit.ux",    "hit.uy",     "hit.uz",   "hit.vx",   "hit.vy",   "hit.vz",  // x_by, y_by
    "texel.ux",  "texel.uy",   "texel.uz", "texel.vx", "texel.vy", "texel.vz",  // TexelAxes, or
    "texel.edge"};                                                              // else, per_texel
using HitMapTexel = std::array<float, kHitMapNames.size()>;

/// The texel of a lane that hit. `lattice`: the size that the hit's texel coordinates are on; 0 x 0
/// where the page has no image, and so no coordinates. `surface`: what SurfacePoints knows of it.
/// `axes`: of the texel's owner; null in a block of records.
HitMapTexel map_texel(const HitPacket& hit, const TexelPacket& texels, const SurfacePacket& surface,
                      std::size_t lane, ImageSize lattice, const surface::TexelAxes* axes);

/// A block's part of a map, row by row: HitMapTexel by texel, `stride` texels from row to row.
struct MapWindow {
  std::span<const float> texels;
  std::size_t stride = 0;
  std::uint32_t width = 0, height = 0;  ///< 1..64 each
};

/// The hits that a part of a map holds: what hits_of() gave when it was made. Throws Error(input),
/// naming the map, for what map_texel() does not make, and for pages beyond `pages`.
HitBlock hits_of_map(const MapWindow& window, std::size_t pages, float max_distance,
                     const std::string& name);

}  // namespace pounce::projection
