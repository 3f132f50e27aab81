// SPDX-License-Identifier: Apache-2.0
//
// What the texels of a block of the target hit, as a value: all that shading asks of a search.
//
// It knows neither images nor filters, so whatever is painted on the source later is looked up at
// the same places, to the same bits: another channel, a repainted texture, another filter.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "core/page_pool.h"
#include "pounce/options.h"
#include "pounce/report.h"
#include "projection/hit_packet.h"
#include "projection/search.h"
#include "surface/target_block.h"

namespace pounce::projection {

/// What all hits on one triangle of the source share.
struct HitFacet {
  std::int32_t page = 0;             ///< of the source
  std::int32_t base[2] = {0, 0};     ///< whole texels that its coordinates are counted from
  float x_by[3] = {}, y_by[3] = {};  ///< see HitPacket
};

struct HitBlock {
  static constexpr std::size_t kTexels = 64 * 64;
  std::array<std::uint8_t, kTexels / 8> mask{};  ///< a bit per texel, y * 64 + x: did it hit?
  std::vector<HitFacet> facets;
  /// The texels' own axes, by triangle of the target; empty for a block of records, whose texels
  /// are known by their edges alone.
  std::vector<surface::TexelAxes> axes;
  // By hit, one 8x8 window of texels after the other.
  std::vector<std::uint16_t> facet;   ///< into `facets`
  std::vector<std::uint16_t> owner;   ///< into `axes`, where there are any
  std::vector<float> per_texel;       ///< else 1 / edge
  std::vector<float> frac_x, frac_y;  ///< texel coordinates beyond the facet's base
  /// How far away the hits are: see count_distances().
  DistanceCounts distances{};
  std::uint64_t distance_steps = 0;

  std::size_t size() const { return facet.size(); }
  /// Marks a texel as hit.
  void mark(std::uint32_t texel) {
    mask[texel / 8] = static_cast<std::uint8_t>(mask[texel / 8] | 1U << texel % 8);
  }
};

/// The texel at a place of the order of a block's hits: window by window, in each row by row.
constexpr std::uint32_t hit_texel(std::uint32_t place) {
  const std::uint32_t window = place / 64, inside = place % 64;
  return (window / 8 * 8 + inside / 8) * 64 + window % 8 * 8 + inside % 8;
}

/// Numbers values in the order in which they are met, equal ones alike: bit for bit, since what is
/// read back must be what was found.
template <class Value>
class NumberedValues {
 public:
  explicit NumberedValues(std::vector<Value>& values) : values_(values) { slots_.fill(kNone); }

  /// `hint` spreads values over the table: equal ones should have the same most of the time.
  std::uint16_t number(std::uint32_t hint, const Value& value) {
    if (last_ != kNone && is_same(values_[last_], value)) return last_;
    auto slot = hint * 2654435769U >> (32 - kBits);  // golden ratio
    while (slots_[slot] != kNone && !is_same(values_[slots_[slot]], value))
      slot = (slot + 1) % kSlots;
    if (slots_[slot] == kNone) {
      slots_[slot] = static_cast<std::uint16_t>(values_.size());
      values_.push_back(value);
    }
    return last_ = slots_[slot];
  }

 private:
  static constexpr std::uint16_t kNone = 0xFFFF;
  static constexpr unsigned kBits = 13;
  static constexpr std::size_t kSlots = 1 << kBits;  // twice what a block can hold

  static bool is_same(const Value& a, const Value& b) {
    static_assert(sizeof(Value) % sizeof(float) == 0 && alignof(Value) == alignof(float));
    return std::memcmp(&a, &b, sizeof a) == 0;
  }

  std::vector<Value>& values_;
  std::array<std::uint16_t, kSlots> slots_;
  std::uint16_t last_ = kNone;
};

/// The hits of one block's packets. `axes`: TargetBlock::axes().
HitBlock hits_of(std::span<const TexelPacket> packets, std::span<const HitPacket> hits,
                 const std::vector<surface::TexelAxes>& axes, float max_distance);

/// Appends the hits as packets, as shading reads them: texel, owner, edge and hit; where rays start
/// and how far they went is not known any more. `block`: its number in the piece.
void append_packets(const HitBlock& block, std::uint32_t number, PageVector<TexelPacket>& packets,
                    UnsetPageVector<HitPacket>& hits);

/// Bytes of so many encoded blocks at most: with so many facets and axes, all together.
constexpr std::uint64_t most_hit_bytes(std::uint64_t blocks, std::uint64_t texels,
                                       std::uint64_t facets, std::uint64_t axes) {
  return blocks * 1024 + texels * (2 * sizeof(std::uint16_t) + 3 * sizeof(float)) +
         facets * sizeof(HitFacet) + axes * sizeof(surface::TexelAxes);
}
/// Bytes of the largest encoded block.
inline constexpr std::uint32_t kMostHitBytes =
    most_hit_bytes(1, HitBlock::kTexels, HitBlock::kTexels, HitBlock::kTexels);
/// Packets of sixteen for so many hits.
constexpr std::size_t hit_packets(std::size_t hits) { return (hits + kLanes - 1) / kLanes; }

/// Serialises a block for compression, and back. decode_hits() throws Error(damaged_store) for what
/// encode() does not make, and for pages beyond `pages`.
void encode(const HitBlock& block, std::vector<std::byte>& raw);
HitBlock decode_hits(std::span<const std::byte> raw, std::size_t pages, const std::string& name);

// --- maps of hits --------------------------------------------------------------------------------
//
// Hits as an image: where on the source each texel's ray ended. docs/hit-map.md is for its readers.

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
