// SPDX-License-Identifier: Apache-2.0
#include "projection/hit_block.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <random>

#include "pounce/error.h"

namespace pounce::projection {
namespace {

/// Packets whose lanes hold what a test says, the rest unused.
struct Packets {
  PageVector<TexelPacket> texels;
  UnsetPageVector<HitPacket> hits;

  void add() {
    TexelPacket& packet = texels.emplace_back(TexelPacket{});
    std::fill_n(packet.texel, kLanes, surface::kNoTexel);
    packet.coarseness = 1;
    clear(hits.emplace_back());
  }
  void put(std::size_t lane, std::uint16_t texel, std::uint16_t owner, std::int32_t id,
           const HitFacet& facet, float x, float y, float distance) {
    TexelPacket& packet = texels.back();
    HitPacket& hit = hits.back();
    packet.texel[lane] = texel;
    packet.owner[lane] = owner;
    packet.per_texel[lane] = 2;
    hit.key[lane] = key_of(distance, packet);
    hit.id[lane] = id;
    hit.page[lane] = facet.page;
    hit.base_x[lane] = facet.base[0];
    hit.base_y[lane] = facet.base[1];
    hit.frac_x[lane] = x;
    hit.frac_y[lane] = y;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      hit.x_by[axis][lane] = facet.x_by[axis];
      hit.y_by[axis][lane] = facet.y_by[axis];
    }
  }
};

const HitFacet kFirst{1, {100, -7}, {1, 2, 3}, {4, 5, 6}};
const HitFacet kSecond{0, {0, 50}, {-1, 0, 0.5F}, {0, 0, 8}};
const std::vector<surface::TexelAxes> kAxes{
    {{1, 0, 0}, {0, 1, 0}}, {{0, 0, 2}, {0, 3, 0}}, {{9, 9, 9}, {8, 8, 8}}};

/// What shading reads of a hit.
struct Read {
  std::uint16_t texel = 0;
  std::int32_t page = 0, base_x = 0, base_y = 0;
  float frac_x = 0, frac_y = 0, per_texel = 0;
  std::array<float, 6> by{};
  surface::TexelAxes axes{};

  bool operator==(const Read& other) const {
    return texel == other.texel && page == other.page && base_x == other.base_x &&
           base_y == other.base_y && frac_x == other.frac_x && frac_y == other.frac_y &&
           per_texel == other.per_texel && by == other.by &&
           std::memcmp(&axes, &other.axes, sizeof axes) == 0;
  }
};

std::vector<Read> read(const PageVector<TexelPacket>& texels,
                       const UnsetPageVector<HitPacket>& hits,
                       const std::vector<surface::TexelAxes>& axes) {
  std::vector<Read> out;
  for (std::size_t p = 0; p < texels.size(); ++p) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const HitPacket& hit = hits[p];
      if (texels[p].texel[lane] == surface::kNoTexel || hit.key[lane] == kNoHit) continue;
      Read r{texels[p].texel[lane],
             hit.page[lane],
             hit.base_x[lane],
             hit.base_y[lane],
             hit.frac_x[lane],
             hit.frac_y[lane],
             0,
             {},
             {}};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        r.by[axis] = hit.x_by[axis][lane];
        r.by[3 + axis] = hit.y_by[axis][lane];
      }
      if (axes.empty()) {
        r.per_texel = texels[p].per_texel[lane];
      } else {
        r.axes = axes[texels[p].owner[lane]];
      }
      out.push_back(r);
    }
  }
  std::sort(out.begin(), out.end(), [](const Read& a, const Read& b) { return a.texel < b.texel; });
  return out;
}

std::vector<std::byte> encoded(const HitBlock& block) {
  std::vector<std::byte> raw;
  encode(block, raw);
  return raw;
}

/// A block's packets after they went through bytes.
Packets stored(const HitBlock& block, std::size_t pages) {
  const HitBlock back = decode_hits(encoded(block), pages, "test");
  Packets out;
  append_packets(back, 5, out.texels, out.hits);
  return out;
}

/// Windows full of hits on many facets.
Packets random_hits(std::mt19937& random, std::size_t packets, int facets) {
  Packets out;
  std::vector<std::uint16_t> texels(HitBlock::kTexels);
  for (std::size_t i = 0; i < texels.size(); ++i) texels[i] = static_cast<std::uint16_t>(i);
  std::shuffle(texels.begin(), texels.end(), random);
  std::uniform_real_distribution<float> number(-2000, 2000);
  std::vector<HitFacet> all;
  for (int f = 0; f < facets; ++f) {
    const auto n = [&] { return number(random); };
    all.push_back({static_cast<std::int32_t>(random() % 3),
                   {static_cast<std::int32_t>(random() % 4096), -17},
                   {n(), n(), n()},
                   {n(), n(), n()}});
  }
  for (std::size_t p = 0; p < packets; ++p) {
    out.add();
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (random() % 5 == 0) continue;
      const auto f = static_cast<std::int32_t>(random() % all.size());
      out.put(lane, texels[p * kLanes + lane], static_cast<std::uint16_t>(random() % kAxes.size()),
              f, all[static_cast<std::size_t>(f)], number(random), number(random),
              std::abs(number(random)));
    }
  }
  return out;
}

}  // namespace

TEST_CASE("hits are kept by texel, each facet and triangle once") {
  Packets given;
  given.add();
  // Texel 64 is the second row of the first window; 8 is in the second window, so it comes last.
  given.put(0, 8, 1, 7, kSecond, 0.25F, 0.5F, 0.5F);
  given.put(3, 64, 0, 3, kFirst, 1.5F, -0.5F, 0.0F);
  given.put(4, 0, 0, 3, kFirst, 2.5F, -0.75F, 1.0F);
  given.texels.back().texel[9] = 70;  // a texel without a hit
  const HitBlock block = hits_of(given.texels, given.hits, kAxes, 1.0F);
  REQUIRE(block.size() == 3);
  CHECK(block.mask[0] == 1);
  CHECK(block.mask[1] == 1);
  CHECK(block.mask[8] == 1);
  CHECK(block.facets.size() == 2);
  CHECK(block.axes.size() == 2);
  CHECK(block.facet == std::vector<std::uint16_t>{0, 0, 1});
  CHECK(block.owner == std::vector<std::uint16_t>{0, 0, 1});
  CHECK(block.frac_x == std::vector<float>{2.5F, 1.5F, 0.25F});
  CHECK(block.frac_y == std::vector<float>{-0.75F, -0.5F, 0.5F});
  CHECK(block.distances[0] == 1);
  CHECK(block.distances[kDistanceBins / 2] == 1);
  CHECK(block.distances[kDistanceBins - 1] == 1);
  CHECK(block.distance_steps == 65536 + 32768);
  const Packets back = stored(block, 2);
  REQUIRE(back.texels.size() == 1);
  CHECK(back.texels[0].block == 5);
  CHECK(read(back.texels, back.hits, block.axes) == read(given.texels, given.hits, kAxes));
}

TEST_CASE("whatever a search found comes back bit for bit") {
  std::mt19937 random(11);
  for (const int facets : {1, 5, 4096}) {
    for (const std::size_t packets : {std::size_t{1}, std::size_t{40}, std::size_t{256}}) {
      const Packets given = random_hits(random, packets, facets);
      const bool of_records = packets == 40;
      const auto& axes = of_records ? std::vector<surface::TexelAxes>{} : kAxes;
      const HitBlock block = hits_of(given.texels, given.hits, axes, 3000.0F);
      CAPTURE(facets, packets);
      CHECK(encoded(block).size() <= kMostHitBytes);
      const Packets back = stored(block, 3);
      CHECK(back.texels.size() == hit_packets(block.size()));
      CHECK(read(back.texels, back.hits, block.axes) == read(given.texels, given.hits, axes));
    }
  }
}

TEST_CASE("two facets of one number stay two") {
  Packets given;
  given.add();
  given.put(0, 0, 0, 3, kFirst, 0, 0, 0);
  given.put(1, 1, 0, 3, kSecond, 0, 0, 0);
  CHECK(hits_of(given.texels, given.hits, kAxes, 1.0F).facets.size() == 2);
}

TEST_CASE("hits that no search makes are refused") {
  std::mt19937 random(3);
  const Packets given = random_hits(random, 20, 9);
  const HitBlock sound = hits_of(given.texels, given.hits, kAxes, 3000.0F);
  const auto refuses = [](const HitBlock& block, std::size_t pages = 3) {
    CHECK_THROWS_AS(decode_hits(encoded(block), pages, "test"), Error);
  };
  CHECK_NOTHROW(decode_hits(encoded(sound), 3, "test"));
  refuses(sound, 2);  // a page that the source does not have
  HitBlock block = sound;
  block.facet[5] = static_cast<std::uint16_t>(block.facets.size());
  refuses(block);
  block = sound;
  block.owner[5] = static_cast<std::uint16_t>(block.axes.size());
  refuses(block);
  block = sound;
  block.frac_x[5] = NAN;
  refuses(block);
  block = sound;
  block.frac_y[5] = 2e9F;
  refuses(block);
  block = sound;
  block.facets[1].base[0] = 1500000000;
  refuses(block);
  block = sound;
  block.mask[100] ^= 4;
  refuses(block);
  block = sound;
  ++block.distances[3];
  refuses(block);
  // Cut short or longer, at every length.
  const std::vector<std::byte> raw = encoded(sound);
  for (std::size_t size = 0; size < raw.size(); size += size < 700 ? 1 : 37)
    CHECK_THROWS_AS(decode_hits(std::span(raw).first(size), 3, "test"), Error);
  std::vector<std::byte> longer = raw;
  longer.emplace_back();
  CHECK_THROWS_AS(decode_hits(longer, 3, "test"), Error);
}

TEST_CASE("mutated hits are refused or keep to their bounds") {
  std::mt19937 random(5);
  const Packets given = random_hits(random, 20, 9);
  const std::vector<std::byte> raw = encoded(hits_of(given.texels, given.hits, kAxes, 3000.0F));
  std::size_t refused = 0, read_on = 0;
  for (int i = 0; i < 4000; ++i) {
    std::vector<std::byte> mutant = raw;
    mutant[random() % mutant.size()] ^= static_cast<std::byte>(1U << random() % 8);
    try {
      const HitBlock block = decode_hits(mutant, 3, "test");
      Packets out;
      append_packets(block, 0, out.texels, out.hits);
      for (const Read& r : read(out.texels, out.hits, block.axes)) {
        REQUIRE(r.texel < HitBlock::kTexels);
        REQUIRE(r.page >= 0);
        REQUIRE(r.page < 3);
      }
      ++read_on;
    } catch (const Error& e) {
      REQUIRE(e.kind() == ErrorKind::damaged_store);
      ++refused;
    }
  }
  CHECK(refused > 400);
  CHECK(read_on > 400);  // coordinates may be any: the pack's checksums know them
}

}  // namespace pounce::projection
