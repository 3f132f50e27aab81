// SPDX-License-Identifier: Apache-2.0
//
// Hits on their way to a store and back. docs/tile-format-hits.md has the bytes.
//
// Most of a hit is said once for its triangle: which page, from where coordinates are counted, and
// how they change over the surface. What is left of each texel are two coordinates and two small
// numbers. Coordinates keep all their bits: their low bytes are noise, which stays in planes of its
// own (store::shuffle), so that the rest compresses and the noise costs little time.
//
// Texels are ordered by windows of 8x8, as packets are, so that sixteen hits in a row lie together
// on the surface, and a triangle's number is mostly the one before it.
#include "projection/hit_block.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/bytes.h"
#include "pounce/error.h"
#include "projection/search.h"
#include "store/pack/codec.h"

namespace pounce::projection {
namespace {

constexpr std::size_t kTexels = HitBlock::kTexels;
constexpr std::uint16_t kNone = 0xFFFF;
/// Coordinates beyond this are a broken mesh (mesh::kLargestTexel); two of them fit an integer.
constexpr float kFarthest = 1e9F;

/// The place of a texel: see hit_texel().
constexpr std::uint32_t place_of_texel(std::uint32_t texel) {
  const std::uint32_t x = texel % 64, y = texel / 64;
  return (y / 8 * 8 + x / 8) * 64 + y % 8 * 8 + x % 8;
}

HitFacet facet_of(const HitPacket& hit, std::size_t lane) {
  HitFacet facet;
  facet.page = hit.page[lane];
  facet.base[0] = hit.base_x[lane];
  facet.base[1] = hit.base_y[lane];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    facet.x_by[axis] = hit.x_by[axis][lane];
    facet.y_by[axis] = hit.y_by[axis][lane];
  }
  return facet;
}

/// Of a packet: not looked at yet, or do all of its lanes have one facet?
enum : std::uint8_t { kUnknown, kYes, kNo };

/// Do all lanes hold the hit of the first one's facet, bit for bit? Most packets lie on one
/// triangle and need no looking up, lane by lane. Without branches: compilers compare sixteen at
/// once.
bool is_on_one_facet(const HitPacket& hit) {
  std::uint32_t differs = 0;
  const auto compare = [&](const auto(&values)[kLanes]) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      differs |=
          std::bit_cast<std::uint32_t>(values[lane]) ^ std::bit_cast<std::uint32_t>(values[0]);
    }
  };
  compare(hit.id);
  compare(hit.page);
  compare(hit.base_x);
  compare(hit.base_y);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    compare(hit.x_by[axis]);
    compare(hit.y_by[axis]);
  }
  return differs == 0;
}

/// What a packet's hits have of their facets.
void put_facets(const HitBlock& block, std::size_t first, std::size_t lanes, HitPacket& hit) {
  const std::uint16_t* const numbers = &block.facet[first];
  const bool is_one =
      std::all_of(numbers, numbers + lanes, [&](std::uint16_t n) { return n == numbers[0]; });
  const auto put = [&](std::size_t lane, std::size_t count, const HitFacet& facet) {
    std::fill_n(hit.page + lane, count, facet.page);
    std::fill_n(hit.base_x + lane, count, facet.base[0]);
    std::fill_n(hit.base_y + lane, count, facet.base[1]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::fill_n(hit.x_by[axis] + lane, count, facet.x_by[axis]);
      std::fill_n(hit.y_by[axis] + lane, count, facet.y_by[axis]);
    }
  };
  if (is_one) return put(0, lanes, block.facets[numbers[0]]);
  for (std::size_t lane = 0; lane < lanes; ++lane) put(lane, 1, block.facets[numbers[lane]]);
}

/// Writes an array as planes of bytes.
template <class T>
void put_planes(std::span<const T> values, std::vector<std::byte>& raw) {
  const std::size_t begin = raw.size();
  raw.resize(begin + values.size_bytes());
  store::shuffle(std::as_bytes(values), alignof(T), std::span(raw).subspan(begin));
}

template <class T>
void get_planes(std::span<const std::byte>& raw, std::vector<T>& values) {
  const std::size_t bytes = values.size() * sizeof(T);
  store::unshuffle(raw.first(bytes), alignof(T), std::as_writable_bytes(std::span(values)));
  raw = raw.subspan(bytes);
}

constexpr std::size_t kHeaderBytes = 3 * sizeof(std::uint32_t) + sizeof(std::uint64_t) +
                                     kDistanceBins * sizeof(std::uint16_t) + kTexels / 8;

/// The rules that a block keeps, whoever wrote it.
void check(const HitBlock& block, std::size_t pages, const ByteReader& in) {
  std::uint64_t counted = 0;
  for (const std::uint64_t count : block.distances) counted += count;
  if (counted != block.size()) in.fail("has a number of distances that differs from its hits");
  for (const HitFacet& facet : block.facets) {
    if (facet.page < 0 || static_cast<std::size_t>(facet.page) >= pages)
      in.fail("refers to a page that the source does not have");
    for (const std::int32_t base : facet.base) {
      if (std::abs(static_cast<double>(base)) > double{kFarthest})
        in.fail("has texels outside of any image");
    }
  }
  const auto is_place = [](float v) { return std::abs(v) <= kFarthest; };  // not of NaN
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (block.facet[i] >= block.facets.size()) in.fail("refers to a missing facet");
    if (!is_place(block.frac_x[i]) || !is_place(block.frac_y[i]))
      in.fail("has texels outside of any image");
  }
  for (const std::uint16_t owner : block.owner) {
    if (owner >= block.axes.size()) in.fail("refers to a missing triangle");
  }
  for (const float edges : block.per_texel) {
    if (!(edges > 0)) in.fail("has a texel without an edge");
  }
}

}  // namespace

HitBlock hits_of(std::span<const TexelPacket> packets, std::span<const HitPacket> hits,
                 const std::vector<surface::TexelAxes>& axes, float max_distance) {
  std::array<std::uint16_t, kTexels> lane_at;  // packet * 16 + lane, in the order of the block
  lane_at.fill(kNone);
  HitBlock out;
  std::size_t count = 0;
  for (std::size_t p = 0; p < packets.size(); ++p) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::uint16_t texel = packets[p].texel[lane];
      if (texel == surface::kNoTexel || hits[p].key[lane] == kNoHit) continue;
      lane_at[place_of_texel(texel)] = static_cast<std::uint16_t>(p * kLanes + lane);
      out.mark(texel);
      const float distance = distance_of(hits[p].key[lane], packets[p]);
      count_distance(distance, max_distance, out.distances);
      out.distance_steps += distance_steps(distance, max_distance);
      ++count;
    }
  }
  out.facet.resize(count);
  out.frac_x.resize(count);
  out.frac_y.resize(count);
  (axes.empty() ? out.per_texel.resize(count) : out.owner.resize(count));
  NumberedValues<HitFacet> facets(out.facets);
  std::vector<std::uint16_t> owners(axes.size(), kNone);  // those that some hit's texel has
  std::vector<std::uint8_t> on_one(packets.size(), kUnknown);
  std::size_t next = 0, before = packets.size();
  for (const std::uint16_t at : lane_at) {
    if (at == kNone) continue;
    const std::size_t p = at / kLanes, lane = at % kLanes;
    if (on_one[p] == kUnknown) on_one[p] = is_on_one_facet(hits[p]) ? kYes : kNo;
    out.facet[next] =
        p == before && on_one[p] == kYes
            ? out.facet[next - 1]
            : facets.number(static_cast<std::uint32_t>(hits[p].id[lane]), facet_of(hits[p], lane));
    before = p;
    out.frac_x[next] = hits[p].frac_x[lane];
    out.frac_y[next] = hits[p].frac_y[lane];
    if (axes.empty()) {
      out.per_texel[next] = packets[p].per_texel[lane];
    } else {
      std::uint16_t& owner = owners[packets[p].owner[lane]];
      if (owner == kNone) {
        owner = static_cast<std::uint16_t>(out.axes.size());
        out.axes.push_back(axes[packets[p].owner[lane]]);
      }
      out.owner[next] = owner;
    }
    ++next;
  }
  return out;
}

void append_packets(const HitBlock& block, std::uint32_t number, PageVector<TexelPacket>& packets,
                    PageVector<HitPacket>& hits) {
  std::array<std::uint16_t, kTexels> texels;
  std::size_t count = 0;
  for (std::uint32_t place = 0; place < kTexels; ++place) {
    const std::uint32_t texel = hit_texel(place);
    if ((block.mask[texel / 8] >> texel % 8 & 1) != 0)
      texels[count++] = static_cast<std::uint16_t>(texel);
  }
  for (std::size_t first = 0; first < count; first += kLanes) {
    const std::size_t lanes = std::min<std::size_t>(kLanes, count - first);
    TexelPacket& packet = packets.emplace_back(TexelPacket{});
    HitPacket& hit = hits.emplace_back();
    packet.block = number;
    std::fill_n(packet.texel, kLanes, surface::kNoTexel);
    std::copy_n(&texels[first], lanes, packet.texel);
    if (block.axes.empty()) {
      std::copy_n(&block.per_texel[first], lanes, packet.per_texel);
    } else {
      std::copy_n(&block.owner[first], lanes, packet.owner);
    }
    std::fill_n(hit.key, lanes, 0);
    std::fill(hit.key + lanes, hit.key + kLanes, kNoHit);
    std::copy_n(&block.frac_x[first], lanes, hit.frac_x);
    std::copy_n(&block.frac_y[first], lanes, hit.frac_y);
    put_facets(block, first, lanes, hit);
  }
}

void encode(const HitBlock& block, std::vector<std::byte>& raw) {
  raw.clear();
  ByteWriter out(raw);
  out.put_all(static_cast<std::uint32_t>(block.size()),
              static_cast<std::uint32_t>(block.facets.size()),
              static_cast<std::uint32_t>(block.axes.size()), block.distance_steps);
  for (const std::uint64_t count : block.distances) out.put(static_cast<std::uint16_t>(count));
  out.put_span(std::span<const std::uint8_t>(block.mask));
  put_planes(std::span<const HitFacet>(block.facets), raw);
  put_planes(std::span<const surface::TexelAxes>(block.axes), raw);
  put_planes(std::span<const std::uint16_t>(block.facet), raw);
  put_planes(std::span<const std::uint16_t>(block.owner), raw);
  put_planes(std::span<const float>(block.per_texel), raw);
  put_planes(std::span<const float>(block.frac_x), raw);
  put_planes(std::span<const float>(block.frac_y), raw);
}

HitBlock decode_hits(std::span<const std::byte> raw, std::size_t pages, const std::string& name) {
  ByteReader in(raw, name);
  if (raw.size() < kHeaderBytes) in.fail("is too small for hits");
  HitBlock block;
  std::uint32_t hits = 0, facets = 0, axes = 0;
  in.get_all(hits, facets, axes, block.distance_steps);
  for (std::uint64_t& count : block.distances) count = in.get<std::uint16_t>();
  std::uint32_t set = 0;
  for (std::uint8_t& bits : block.mask) {
    bits = in.get<std::uint8_t>();
    set += static_cast<std::uint32_t>(std::popcount(bits));
  }
  if (hits != set) in.fail("has a number of hits that differs from its mask");
  if (facets > hits || axes > hits) in.fail("has more triangles than hits");
  std::span<const std::byte> planes = raw.subspan(kHeaderBytes);
  const std::size_t by_hit = 2 * sizeof(float) + sizeof(std::uint16_t) +
                             (axes > 0 ? sizeof(std::uint16_t) : sizeof(float));
  if (planes.size() !=
      facets * sizeof(HitFacet) + axes * sizeof(surface::TexelAxes) + hits * by_hit)
    in.fail("has a different size than its counts state");
  block.facets.resize(facets);
  block.axes.resize(axes);
  block.facet.resize(hits);
  block.owner.resize(axes > 0 ? hits : 0);
  block.per_texel.resize(axes > 0 ? 0 : hits);
  block.frac_x.resize(hits);
  block.frac_y.resize(hits);
  get_planes(planes, block.facets);
  get_planes(planes, block.axes);
  get_planes(planes, block.facet);
  get_planes(planes, block.owner);
  get_planes(planes, block.per_texel);
  get_planes(planes, block.frac_x);
  get_planes(planes, block.frac_y);
  check(block, pages, in);
  return block;
}

}  // namespace pounce::projection
