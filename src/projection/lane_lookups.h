// SPDX-License-Identifier: Apache-2.0
//
// Sets of lookups of sixteen texels over the tiles of an image.
#pragma once

#include <algorithm>
#include <bit>

#include "projection/blend.h"
#include "projection/blend_lanes.h"

namespace pounce::projection {

template <class Visit>
void for_each_lane(unsigned lanes, Visit&& visit) {
  for (; lanes != 0; lanes &= lanes - 1) visit(static_cast<std::size_t>(std::countr_zero(lanes)));
}

/// blend(tile, share, lanes) for each tile that active lanes of `places` lie in; tile_at(x, y)
/// gives its samples, until the next is asked for. The share of the other lanes is 0.
template <class TileAt, class Blend>
void for_each_tile(const PlacesLanes& places, TileAt&& tile_at, Blend&& blend) {
  for (unsigned left = places.active; left != 0;) {
    const std::int32_t tile = places.tile[static_cast<std::size_t>(std::countr_zero(left))];
    unsigned same = 0;
    for (std::size_t lane = 0; lane < places.tile.size(); ++lane)
      same |= static_cast<unsigned>(places.tile[lane] == tile) << lane;
    same &= left;
    left &= ~same;
    const std::byte* const samples =
        tile_at(static_cast<std::uint32_t>(tile & 0xFFFF), static_cast<std::uint32_t>(tile >> 16));
    if (same == places.active) {
      blend(samples, places.share, same);
      continue;
    }
    alignas(64) Sixteen<double> share{};
    for_each_lane(same, [&](std::size_t lane) { share[lane] = places.share[lane]; });
    blend(samples, share, same);
  }
}

/// Where sixteen texels look.
struct alignas(64) MiddlesLanes {
  Sixteen<double> x, y;
};

/// Adds a set of lookups of `lanes`, in one image or level of 8 bits, to `means`. `places` is
/// overwritten.
template <class TileAt>
void add_lookups(const BlendLanes& kernels, double keys, const LookupsLanes& set,
                 const FootprintLookupsLanes* sharpening, const LookedUp& in,
                 const MiddlesLanes& middles, unsigned lanes, TileAt&& tile_at, PlacesLanes& places,
                 MeansLanes& means) {
  std::int32_t count_a = 0, count_b = 0;
  for_each_lane(lanes, [&](std::size_t lane) {
    count_a = std::max(count_a, set.count_a[lane]);
    count_b = std::max(count_b, set.count_b[lane]);
  });
  for (std::int32_t a = 0; a < count_a; ++a) {
    for (std::int32_t b = 0; b < count_b; ++b) {
      kernels.place(set, in, middles.x, middles.y, a, b, lanes, places);
      for_each_lane(places.outside, [&](std::size_t lane) {
        places.set_place(lane, placed(places.x[lane], in.level_width, in.wrap_u),
                         placed(places.y[lane], in.level_height, in.wrap_v), in.channels);
      });
      for_each_tile(places, tile_at, [&](const std::byte* tile, const auto& share, unsigned) {
        kernels.add_u8[in.channels - 1](tile, places, share, keys, sharpening, means);
      });
    }
  }
}

}  // namespace pounce::projection
