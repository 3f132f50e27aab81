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

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/bytes.h"
#include "core/portable_math.h"
#include "mesh/uv_tiles.h"
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
                    UnsetPageVector<HitPacket>& hits) {
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
    HitPacket& hit = hits.emplace_back(HitPacket{});
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

// --- maps of hits --------------------------------------------------------------------------------
//
// A map is read by two kinds of readers. People and compositors take u, v, UDIM, distance and
// angle. `pounce apply` takes the rest: hits as they were found, so that what it paints is what a
// transfer paints, to the bit. Texel coordinates are two numbers for that, a whole one and a
// fraction: their sum as one float would lose bits.
//
// A hit's key has its distance alone: on which side of the texel the source lies, and how it is
// turned, says the facet, which is gone when the search is over. SurfacePoints keeps both while the
// facet is there.

namespace {

/// A coordinate in images side by side: which of them, and where in it, 0 to 1.
struct Split {
  std::int32_t period = 0;
  double rest = 0;
};

Split split(std::int32_t base, float frac, std::uint32_t size) {
  const double in_images = (static_cast<double>(base) + frac + 0.5) / size;
  const double whole = std::floor(in_images);
  return {static_cast<std::int32_t>(whole), in_images - whole};
}

/// Between two directions of unit length. The halves of their sum and difference are the cosine and
/// sine of half the angle, both exact where an arc cosine is not: at small angles.
double degrees_between(Vec3d a, Vec3d b) {
  constexpr double kDegrees = 0x1.ca5dc1a63c1f8p+5;  // 180 / pi
  return 2 * kDegrees * atan_same(length(a - b) / length(a + b));
}

/// Whole numbers up to this are exact as floats. Coordinates beyond are a source whose UVs repeat
/// an image thousands of times.
constexpr std::int32_t kMostWhole = 1 << 24;
/// Instead of a page: the place is no float.
constexpr float kNoPage = -1;

enum : std::size_t {
  kCoverage = 2,
  kDistance = 4,
  kPage = 6,
  kBase = 7,
  kFrac = 9,
  kBy = 11,
  kAxes = 17,
  kEdge = 23
};

bool is_whole(float value, double most) {
  return std::abs(double{value}) <= most && std::trunc(value) == value;  // not of NaN
}

/// Reads the texels of a block in the order of its hits.
class MapReading {
 public:
  MapReading(const MapWindow& window, std::size_t pages, float max_distance,
             const std::string& name)
      : window_(window), pages_(pages), max_distance_(max_distance), name_(name) {}

  HitBlock read() {
    for (std::uint32_t place = 0; place < HitBlock::kTexels; ++place) {
      const std::uint32_t texel = hit_texel(place), x = texel % 64, y = texel / 64;
      if (x >= window_.width || y >= window_.height) continue;
      const float* const values =
          window_.texels.data() + (y * window_.stride + x) * kHitMapNames.size();
      if (values[kCoverage] == 0) continue;
      if (values[kCoverage] != 1) refuse("coverage is neither 0 nor 1");
      block_.mark(texel);
      add_hit(values);
      add_texel(values);
    }
    if (!block_.axes.empty() && !block_.per_texel.empty())
      refuse("some texels have axes and others of the same block have none");
    return std::move(block_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ErrorKind::input,
                fmt::format("{}: {}; write the map again, and do not edit, resize or convert it",
                            name_, what));
  }

  void add_hit(const float* values) {
    if (values[kPage] == kNoPage) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: some texels lie more than {} texels from the source's origin of "
                              "UV space, and a map is not exact there; use pounce transfer",
                              name_, kMostWhole));
    }
    if (!is_whole(values[kPage], static_cast<double>(pages_ - 1)) || values[kPage] < 0)
      refuse("its hits are on materials that the source does not have");
    HitFacet facet;
    facet.page = static_cast<std::int32_t>(values[kPage]);
    for (std::size_t i = 0; i < 2; ++i) {
      if (!is_whole(values[kBase + i], kMostWhole))
        refuse("a texel coordinate is not a whole number");
      facet.base[i] = static_cast<std::int32_t>(values[kBase + i]);
      if (!(std::abs(double{values[kFrac + i]}) <= kMostWhole))
        refuse("a texel coordinate is not a number");
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      facet.x_by[axis] = values[kBy + axis];
      facet.y_by[axis] = values[kBy + 3 + axis];
    }
    const auto hint =
        std::bit_cast<std::uint32_t>(facet.x_by[0]) ^ std::bit_cast<std::uint32_t>(facet.y_by[1]);
    block_.facet.push_back(facets_.number(hint, facet));
    block_.frac_x.push_back(values[kFrac]);
    block_.frac_y.push_back(values[kFrac + 1]);
    const float distance = std::abs(values[kDistance]);
    if (!std::isfinite(distance)) refuse("a distance is not a number");
    count_distance(distance, max_distance_, block_.distances);
    block_.distance_steps += distance_steps(distance, max_distance_);
  }

  void add_texel(const float* values) {
    if (values[kEdge] != 0) {
      if (!(values[kEdge] > 0)) refuse("a texel has no size");
      block_.per_texel.push_back(values[kEdge]);
      return;
    }
    surface::TexelAxes axes;
    axes.x = {values[kAxes], values[kAxes + 1], values[kAxes + 2]};
    axes.y = {values[kAxes + 3], values[kAxes + 4], values[kAxes + 5]};
    const auto hint =
        std::bit_cast<std::uint32_t>(axes.x.x) ^ std::bit_cast<std::uint32_t>(axes.y.y);
    block_.owner.push_back(axes_.number(hint, axes));
  }

  const MapWindow& window_;
  const std::size_t pages_;
  const float max_distance_;
  const std::string& name_;
  HitBlock block_;
  NumberedValues<HitFacet> facets_{block_.facets};
  NumberedValues<surface::TexelAxes> axes_{block_.axes};
};

}  // namespace

HitMapTexel map_texel(const HitPacket& hit, const TexelPacket& texels, const SurfacePacket& surface,
                      std::size_t lane, ImageSize lattice, const surface::TexelAxes* axes) {
  HitMapTexel out{};
  out[kCoverage] = 1;
  if (lattice.width > 0) {
    const Split x = split(hit.base_x[lane], hit.frac_x[lane], lattice.width);
    const Split y = split(hit.base_y[lane], hit.frac_y[lane], lattice.height);
    out[0] = static_cast<float>(x.rest);
    out[1] = static_cast<float>(1 - y.rest);
    out[3] =
        static_cast<float>(mesh::udim_number(mesh::tile_of_period(x.period, y.period)).value_or(0));
  }
  const float distance = distance_of(hit.key[lane], texels);
  out[kDistance] = surface.height[lane] < 0 ? -distance : distance;
  const Vec3d normal{surface.nx[lane], surface.ny[lane], surface.nz[lane]};
  const Vec3d own{texels.nx[lane], texels.ny[lane], texels.nz[lane]};
  const double size = length(normal), own_size = length(own);
  if (size > 0 && own_size > 0)
    out[5] = static_cast<float>(degrees_between(normal * (1 / size), own * (1 / own_size)));
  const std::array<std::int32_t, 2> base{hit.base_x[lane], hit.base_y[lane]};
  out[kPage] = static_cast<float>(hit.page[lane]);
  for (std::size_t i = 0; i < 2; ++i) {
    out[kBase + i] = static_cast<float>(base[i]);
    if (std::abs(std::int64_t{base[i]}) > kMostWhole) out[kPage] = kNoPage;
  }
  out[kFrac] = hit.frac_x[lane];
  out[kFrac + 1] = hit.frac_y[lane];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    out[kBy + axis] = hit.x_by[axis][lane];
    out[kBy + 3 + axis] = hit.y_by[axis][lane];
  }
  if (axes == nullptr) {
    out[kEdge] = texels.per_texel[lane];
  } else {
    const std::array<float, 6> six{axes->x.x, axes->x.y, axes->x.z,
                                   axes->y.x, axes->y.y, axes->y.z};
    std::copy(six.begin(), six.end(), out.begin() + kAxes);
  }
  return out;
}

HitBlock hits_of_map(const MapWindow& window, std::size_t pages, float max_distance,
                     const std::string& name) {
  return MapReading(window, pages, max_distance, name).read();
}

}  // namespace pounce::projection
