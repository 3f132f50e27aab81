// SPDX-License-Identifier: Apache-2.0
//
// What footprint.h and blend.h say of one target texel, of sixteen at once: the same bits.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>

#include "pounce/options.h"
#include "projection/blend.h"
#include "projection/footprint.h"
#include "projection/hit_packet.h"
#include "store/blocks/colour_store.h"
#include "surface/target_block.h"

namespace pounce::projection {

template <class T>
using Sixteen = std::array<T, surface::kLanes>;

/// Vec2d of sixteen texels.
struct alignas(64) Vec2Lanes {
  Sixteen<double> x, y;
};

/// TexelAxes of sixteen texels.
struct alignas(64) AxesLanes {
  std::array<Sixteen<float>, 3> x, y;
};

/// Footprint of sixteen texels.
struct alignas(64) FootprintLanes {
  Sixteen<double> ax, ay, bx, by;
};

/// Lookups of sixteen texels. `share` is of each lookup, not of all of them.
struct alignas(64) LookupsLanes {
  Sixteen<double> step_ax, step_ay, step_bx, step_by, share;
  Sixteen<std::int32_t> level, count_a, count_b;
};

/// FootprintLookups of sixteen texels.
struct alignas(64) FootprintLookupsLanes {
  std::array<LookupsLanes, 2> sets;
  Sixteen<std::int32_t> across, down;  ///< their Sharpening
  unsigned two = 0;                    ///< lanes that have two sets
  unsigned single = 0;                 ///< lanes that are one lookup in the image itself
};

/// The image or level that a set of lookups goes to.
struct LookedUp {
  std::uint32_t width = 0, height = 0;              ///< of the image that places are texels of
  std::uint32_t level_width = 0, level_height = 0;  ///< of what is looked up in
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
  bool is_float = false;  ///< samples are halves or floats: places near a centre are it
};

/// One lookup of sixteen texels.
struct alignas(64) PlacesLanes {
  Sixteen<double> x, y;            ///< in the image or level, not wrapped
  Sixteen<double> rest_x, rest_y;  ///< of them beyond the texel
  Sixteen<double> share;           ///< of the result; 0 in lanes without lookup
  Sixteen<std::int32_t> tile;      ///< its row * 65536 + its column
  Sixteen<std::int32_t> offset;    ///< in the tile, in texels, of the first of 4x4 texels
  unsigned active = 0;             ///< lanes that have a lookup
  unsigned outside = 0;            ///< of these the ones beyond the image: set_place() says where

  void set_place(std::size_t lane, Coordinate at_x, Coordinate at_y);
  /// Of float images: places near a centre are it, see settled().
  void settle();
};

/// Taps of sixteen texels: the same for all images that are looked up there.
struct alignas(64) WeightsLanes {
  bool is_tent = false, is_sharp_across = false, is_sharp_down = false;
  std::array<Sixteen<std::int32_t>, 4> across, down;  ///< of a tent `across` alone: of the square
  std::array<Sixteen<std::int32_t>, 2> move_across, move_down;  ///< along axes that are sharpened
};

/// Sharpening of sixteen texels, along each axis of the image; null where no texel's is any: then
/// kernels skip the work for all.
struct SharpeningLanes {
  const Sixteen<std::int32_t>*across = nullptr, *down = nullptr;
};

/// Sums of sixteen texels, by channel.
using MeansLanes = std::array<Sixteen<double>, 4>;

/// The lanes' kernels, one build per instruction set; all give the same bits as the functions of
/// one texel. noexcept and thread-safe.
struct BlendLanes {
  const char* isa;  ///< "sse2", "avx2", "avx512"
  /// footprint_of() the hits on texels with these axes, times `scale`; 0 but in `lanes`.
  void (*footprints)(const HitPacket& hit, const AxesLanes& axes, const Vec2Lanes& scale,
                     unsigned lanes, FootprintLanes& out);
  /// lookups_of(), for images of so many levels.
  void (*lookups)(const FootprintLanes& footprints, const Sixteen<std::int32_t>& last_level,
                  FootprintLookupsLanes& out);
  /// The lookups number `a` along the first side and `b` along the second of the lanes in `lanes`
  /// that have so many, around these places.
  void (*place)(const LookupsLanes& set, const LookedUp& in, const Vec2Lanes& middles, int a, int b,
                unsigned lanes, PlacesLanes& out);
  /// The places of one lookup for each hit in `lanes`, in an image of the size that hits are
  /// counted on: placed() there.
  void (*place_hits)(const HitPacket& hit, const LookedUp& in, unsigned lanes, PlacesLanes& out);
  /// The weights of lookups at `places`. `keys` is the kernel's a, or kTent, of which there is no
  /// sharpening.
  void (*weigh)(const PlacesLanes& places, double keys, const SharpeningLanes& sharpening,
                WeightsLanes& out);
  /// Adds share x blend() to `means`, for lookups that lie in one tile; offsets of the other lanes
  /// are in it, too, and their share is 0. By depth, and channels less 1. Tents are of 8 bits
  /// alone. Where samples of floats are -0, what is 0 may have another sign than there.
  using Add = void (*)(const std::byte* tile, const PlacesLanes& places,
                       const WeightsLanes& weights, const Sixteen<double>& share,
                       MeansLanes& means);
  std::array<std::array<Add, 4>, 4> add;
  /// Rounds means of `channels` to 8 bits, as store_texel() does: four bytes for each lane.
  void (*round_means)(const MeansLanes& means, std::size_t channels,
                      Sixteen<std::uint32_t>& texels);
  /// blend_u8(): four bytes for each lane.
  using Round = void (*)(const std::byte* tile, const PlacesLanes& places,
                         const WeightsLanes& weights, Sixteen<std::uint32_t>& texels);
  std::array<Round, 4> round_u8;
};

/// The kernels for `isa`, as instruction_set() chooses.
const BlendLanes& blend_lanes(const std::string& isa);

// --- lookups over tiles --------------------------------------------------------------------------
//
// Sets of lookups of sixteen texels over the tiles of an image.

template <class Visit>
void for_each_lane(unsigned lanes, Visit&& visit) {
  for (; lanes != 0; lanes &= lanes - 1) visit(static_cast<std::size_t>(std::countr_zero(lanes)));
}

/// A lane's bit, by lane: loops over all lanes that use it become vector code.
inline constexpr Sixteen<std::uint32_t> kLaneBit = [] {
  Sixteen<std::uint32_t> bits{};
  for (std::size_t lane = 0; lane < bits.size(); ++lane) bits[lane] = 1U << lane;
  return bits;
}();

/// The lanes that hold `value`.
template <class T>
unsigned lanes_with(const Sixteen<T>& values, T value) {
  unsigned lanes = 0;
  for (std::size_t lane = 0; lane < values.size(); ++lane)
    lanes |= values[lane] == value ? kLaneBit[lane] : 0;
  return lanes;
}

/// Replaces what `lanes` hold by what they have in `by`.
template <class T>
void replace(unsigned lanes, const Sixteen<T>& by, Sixteen<T>& values) {
  for (std::size_t lane = 0; lane < values.size(); ++lane)
    values[lane] = (lanes & kLaneBit[lane]) != 0 ? by[lane] : values[lane];
}

/// The largest of what `lanes` hold, which is not negative.
inline std::int32_t largest(unsigned lanes, const Sixteen<std::int32_t>& values) {
  std::int32_t most = 0;
  for (std::size_t lane = 0; lane < values.size(); ++lane)
    most = std::max(most, (lanes & kLaneBit[lane]) != 0 ? values[lane] : 0);
  return most;
}

/// The sharpening of `lanes`.
inline SharpeningLanes sharpening_of(const FootprintLookupsLanes& lookups, unsigned lanes) {
  std::int32_t across = 0, down = 0;
  for (std::size_t lane = 0; lane < surface::kLanes; ++lane) {
    const std::int32_t all = (lanes & kLaneBit[lane]) != 0 ? -1 : 0;
    across |= all & lookups.across[lane];
    down |= all & lookups.down[lane];
  }
  return {across != 0 ? &lookups.across : nullptr, down != 0 ? &lookups.down : nullptr};
}

/// blend(tile, share, lanes) for each tile that active lanes of `places` lie in; tile_at(x, y)
/// gives its samples, until the next is asked for. The share of the other lanes is 0.
template <class TileAt, class Blend>
void for_each_tile(const PlacesLanes& places, TileAt&& tile_at, Blend&& blend) {
  for (unsigned left = places.active; left != 0;) {
    const std::int32_t tile = places.tile[static_cast<std::size_t>(std::countr_zero(left))];
    const unsigned same = lanes_with(places.tile, tile) & left;
    left &= ~same;
    const std::byte* const samples =
        tile_at(static_cast<std::uint32_t>(tile & 0xFFFF), static_cast<std::uint32_t>(tile >> 16));
    if (same == places.active) {
      blend(samples, places.share, same);
      continue;
    }
    alignas(64) Sixteen<double> share{};
    replace(same, places.share, share);
    blend(samples, share, same);
  }
}

/// visit() for each lookup of a set, of `lanes`, in one image or level: `places` and `weights` are
/// then of that lookup.
template <class Visit>
void for_each_lookup(const BlendLanes& kernels, double keys, const LookupsLanes& set,
                     const SharpeningLanes& sharpening, const LookedUp& in,
                     const Vec2Lanes& middles, unsigned lanes, PlacesLanes& places,
                     WeightsLanes& weights, Visit&& visit) {
  const std::int32_t count_a = largest(lanes, set.count_a), count_b = largest(lanes, set.count_b);
  for (std::int32_t a = 0; a < count_a; ++a) {
    for (std::int32_t b = 0; b < count_b; ++b) {
      kernels.place(set, in, middles, a, b, lanes, places);
      for_each_lane(places.outside, [&](std::size_t lane) {
        places.set_place(lane, placed(places.x[lane], in.level_width, in.wrap_u),
                         placed(places.y[lane], in.level_height, in.wrap_v));
      });
      if (in.is_float) places.settle();
      kernels.weigh(places, keys, sharpening, weights);
      visit();
    }
  }
}

}  // namespace pounce::projection
