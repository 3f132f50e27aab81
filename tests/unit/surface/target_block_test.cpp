// SPDX-License-Identifier: Apache-2.0
#include "surface/target_block.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>

#include "mesh/uv_raster.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::surface;
using pounce::test::Random;

namespace {

constexpr mesh::Lattice kImage{128, 128, 0, {}};

/// A block of triangles in texels of a 128x128 image, owners by the raster.
struct BlockMaker {
  store::GeometryBlock block;
  BlockMaker(std::int32_t x, std::int32_t y) {
    block.x = x;
    block.y = y;
    block.owner.assign(store::kTexelsPerBlock, store::kNoTriangle);
  }
  struct Corner {
    Vec2d texel;
    Vec3f position, normal;
  };
  void add(std::array<Corner, 3> corners) {
    const auto first = static_cast<std::uint16_t>(block.positions.size());
    const auto triangle = static_cast<std::uint16_t>(block.triangles.size());
    std::array<Vec2d, 3> texels;
    for (std::size_t k = 0; k < 3; ++k) {
      texels[k] = corners[k].texel;
      block.positions.push_back(corners[k].position);
      block.normals.push_back(corners[k].normal);
      block.uvs.push_back({static_cast<float>((texels[k].x + 0.5) / 128),
                           static_cast<float>((texels[k].y + 0.5) / 128)});
      block.tangents.push_back({});
    }
    block.triangles.push_back(
        {first, static_cast<std::uint16_t>(first + 1), static_cast<std::uint16_t>(first + 2)});
    block.ids.push_back(triangle);
    const std::int64_t x0 = block.x * 64, y0 = block.y * 64;
    mesh::raster_triangle(texels, {x0, y0, x0 + 64, y0 + 64},
                          [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
                            for (std::int64_t x = begin; x < end; ++x) {
                              auto& owner =
                                  block.owner[static_cast<std::size_t>((y - y0) * 64 + x - x0)];
                              if (owner == store::kNoTriangle) owner = triangle;
                            }
                          });
  }
};

/// Texel (x, y) is at (x/2, 100 - y/4, 7); half a unit by a quarter.
BlockMaker::Corner flat_corner(double x, double y, Vec3f normal) {
  return {{x, y}, {static_cast<float>(x / 2), static_cast<float>(100 - y / 4), 7}, normal};
}

std::set<std::uint32_t> covered(const TargetBlock& map) {
  std::set<std::uint32_t> texels;
  for (std::uint32_t i = 0; i < store::kTexelsPerBlock; ++i) {
    if (map.covered(i)) texels.insert(i);
  }
  return texels;
}

struct Packets {
  PageVector<TexelPacket> packets;
  std::vector<PacketGroup> groups;
};

/// Checks what holds for any block's packets and returns them.
Packets checked_packets(const TargetBlock& map,
                        TargetBlock::Order order = TargetBlock::Order::in_windows) {
  Packets out;
  map.make_packets(5, out.packets, out.groups, order);
  CHECK(map.count_packets(order) == out.packets.size());
  std::multiset<std::uint32_t> used;
  for (const TexelPacket& packet : out.packets) {
    CHECK(packet.block == 5);
    CHECK(packet.texel[0] != kNoTexel);
    for (int lane = 0; lane < kLanes; ++lane) {
      const Vec3f p{packet.px[lane], packet.py[lane], packet.pz[lane]};
      const Vec3f n{packet.nx[lane], packet.ny[lane], packet.nz[lane]};
      if (packet.texel[lane] == kNoTexel) {
        CHECK(n == Vec3f{});
        CHECK(p == Vec3f{packet.px[0], packet.py[0], packet.pz[0]});
        continue;
      }
      const std::uint32_t texel = packet.texel[lane];
      used.insert(texel);
      const TargetBlock::Texel expected = map.texel(texel);
      CHECK((p == expected.position && n == expected.normal));
      CHECK(packet.per_texel[lane] == expected.per_texel);
      if (order == TargetBlock::Order::in_space) continue;
      const std::uint32_t first = packet.texel[0];  // all in one 8x8 window
      CHECK((texel % 64 / 8 == first % 64 / 8 && texel / 64 / 8 == first / 64 / 8));
    }
  }
  const std::set<std::uint32_t> all = covered(map);
  CHECK(used == std::multiset<std::uint32_t>(all.begin(), all.end()));
  CHECK(out.packets.size() <= TargetBlock::most_packets(static_cast<std::uint32_t>(all.size())));
  std::uint32_t next = 0;
  for (const PacketGroup& group : out.groups) {  // groups cut the packets without gap
    CHECK(group.first == next);
    CHECK(group.count > 0);
    next += group.count;
  }
  CHECK(next == out.packets.size());
  return out;
}

}  // namespace

namespace {

/// A chart of 4x4 texels with edges of one unit in the corner of one 8x8 window after the other, at
/// `places`, facing `normals`.
BlockMaker small_charts(const std::vector<Vec3f>& places, const std::vector<Vec3f>& normals) {
  BlockMaker maker(0, 0);
  for (std::size_t w = 0; w < places.size(); ++w) {
    const double left = static_cast<double>(w % 8 * 8) - 0.5,
                 top = static_cast<double>(w / 8 * 8) - 0.5;
    const auto corner = [&](float x, float y) {
      return BlockMaker::Corner{
          {left + double{x}, top + double{y}}, places[w] + Vec3f{x, y, 0}, normals[w]};
    };
    maker.add({corner(0, 0), corner(4, 0), corner(4, 4)});
    maker.add({corner(0, 0), corner(4, 4), corner(0, 4)});
  }
  return maker;
}

constexpr auto kInSpace = TargetBlock::Order::in_space;

}  // namespace

TEST_CASE("small charts share packets with what lies near them, wherever that is in the image") {
  // A strip of 64 charts, strewn over the block.
  std::vector<Vec3f> places;
  for (int w = 0; w < 64; ++w) places.push_back({static_cast<float>(w * 37 % 64 * 4), 0, 0});
  const TargetBlock map(small_charts(places, std::vector<Vec3f>(64, {0, 0, 1})).block, kImage,
                        1e-6F);
  const Packets own = checked_packets(map), shared = checked_packets(map, kInSpace);
  CHECK(own.groups.size() == 64);
  CHECK(shared.packets.size() == 64);  // none has an empty lane
  CHECK(shared.groups.size() == 16);
  for (const PacketGroup& group : shared.groups) {
    float first = 1e9F, last = 0;
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      for (const float x : shared.packets[p].px) {
        first = std::min(first, x);
        last = std::max(last, x);
      }
    }
    CHECK(last - first == 15);  // four charts, side by side
  }
}

TEST_CASE("what turns its back shares no group, however near it is") {
  // Sixteen charts one unit above sixteen that face the other way.
  std::vector<Vec3f> places, normals;
  for (int w = 0; w < 32; ++w) {
    places.push_back({static_cast<float>(w / 2 * 4), 0, static_cast<float>(w % 2)});
    normals.push_back({0, 0, w % 2 == 0 ? -1.0F : 1.0F});
  }
  const Packets shared =
      checked_packets(TargetBlock(small_charts(places, normals).block, kImage, 1e-6F), kInSpace);
  CHECK(shared.groups.size() == 8);
  for (const PacketGroup& group : shared.groups) {
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      for (const float z : shared.packets[p].nz) CHECK(z == shared.packets[group.first].nz[0]);
    }
  }
}

TEST_CASE("packets in space are no more than promised, whatever charts there are") {
  Random random(2718);
  for (int round = 0; round < 40; ++round) {
    // Texels of their own triangles, strewn, from all in one place to all apart; of every other
    // block they face all ways, so that nothing but normals may keep them apart.
    const float strewn = std::ldexp(1.0F, 2 * round / 3 - 4);
    const bool all_ways = random.one_in(2);
    const auto height = random.whole(1, 64);
    BlockMaker maker(0, 0);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < 64; ++x) {
        if (random.one_in(5)) continue;
        const auto at = [&] { return static_cast<float>(random.between(0.0, 1.0)) * strewn; };
        const auto turn = [&] { return static_cast<float>(random.between(-1.0, 1.0)); };
        const Vec3f place{at(), at(), at()};
        const Vec3f normal{turn() / 2, turn() / 2, all_ways ? turn() : 1};
        const auto corner = [&](double dx, double dy) {
          return BlockMaker::Corner{{x + dx, y + dy}, place + Vec3f(Vec3d{dx, dy, 0}), normal};
        };
        maker.add({corner(-0.25, -0.25), corner(0.5, -0.25), corner(-0.25, 0.5)});
      }
    }
    checked_packets(TargetBlock(maker.block, kImage, 1e-6F), kInSpace);
  }
}

TEST_CASE("positions, normals and texel sizes of a hand-made quad") {
  BlockMaker maker(1, 0);
  const Vec3f up{0, 0, 1}, right{1, 0, 0};
  // Texels 70..110 x 10..50. The normal turns from up at x = 70 to right at x = 110.
  maker.add({flat_corner(70, 10, up), flat_corner(110, 10, right), flat_corner(110, 50, right)});
  maker.add({flat_corner(70, 10, up), flat_corner(110, 50, right), flat_corner(70, 50, up)});
  const TargetBlock map(maker.block, kImage, 1e-6F);
  CHECK(covered(map).size() == 40 * 40);
  for (std::uint32_t y = 10; y < 50; ++y) {
    for (std::uint32_t x = 6; x < 46; ++x) {
      const TargetBlock::Texel t = map.texel(y * 64 + x);
      const double image_x = x + 64, turned = (image_x - 70) / 40;
      CHECK(t.position.x == Approx(image_x / 2).epsilon(1e-6));
      CHECK(t.position.y == Approx(100 - y / 4.0).epsilon(1e-6));
      CHECK(t.position.z == 7);
      const double size = std::hypot(turned, 1 - turned);
      CHECK(t.normal.x == Approx(turned / size).margin(1e-6));
      CHECK(t.normal.y == Approx(0).margin(1e-6));
      CHECK(t.normal.z == Approx((1 - turned) / size).margin(1e-6));
      CHECK(t.per_texel == Approx(1 / std::sqrt(0.5 * 0.25)));
    }
  }
  CHECK(checked_packets(map).groups.size() == 36);  // windows 0..5 across, 1..6 down
}

TEST_CASE("a triangle without area in space has the smallest edge, not an infinite density") {
  BlockMaker maker(0, 0);
  BlockMaker::Corner a = flat_corner(0, 0, {0, 0, 1}), b = flat_corner(20, 0, {0, 0, 1}),
                     c = flat_corner(0, 20, {0, 0, 1});
  a.position = b.position = c.position = {3, 4, 5};
  maker.add({a, b, c});
  const TargetBlock map(maker.block, kImage, 0.125F);
  CHECK(map.texel(64 + 1).per_texel == 8);
  CHECK(map.texel(64 + 1).position == Vec3f{3, 4, 5});
}

TEST_CASE("normals that cancel out are zero, not NaN") {
  BlockMaker maker(0, 0);
  maker.add({flat_corner(0, 0, {0, 0, 1}), flat_corner(20, 0, {0, 0, -1}),
             flat_corner(0, 20, {0, 0, 1})});
  const TargetBlock map(maker.block, kImage, 1e-6F);
  CHECK(map.texel(10).normal == Vec3f{});
  CHECK(map.texel(9).normal == Vec3f{0, 0, 1});
}

TEST_CASE("packets hold every covered texel once, whatever is covered") {
  Random random(31);
  for (int round = 0; round < 40; ++round) {
    BlockMaker maker(0, 1);
    const Vec3f up{0, 0, 1};
    maker.add({flat_corner(-1, 63, up), flat_corner(300, 63, up), flat_corner(-1, 300, up)});
    const std::uint64_t holes = 1 + random.below(20);
    for (auto& owner : maker.block.owner) {
      if (!random.one_in(holes)) owner = store::kNoTriangle;
    }
    checked_packets(TargetBlock(maker.block, kImage, 1e-6F));
  }
  BlockMaker nothing(0, 0);
  nothing.add({flat_corner(0, 0, {}), flat_corner(0.5, 0.5, {}), flat_corner(0.25, 0.5, {})});
  nothing.block.owner.assign(store::kTexelsPerBlock, store::kNoTriangle);
  CHECK(checked_packets(TargetBlock(nothing.block, kImage, 1e-6F)).packets.empty());
}

TEST_CASE("texels of charts far apart never share a packet, up to four of them") {
  const std::uint32_t charts = GENERATE(2U, 3U, 4U, 6U);
  BlockMaker maker(0, 0);
  for (std::uint32_t chart = 0; chart < charts; ++chart) {
    std::array<BlockMaker::Corner, 3> corners{flat_corner(-1, -1, {0, 0, 1}),
                                              flat_corner(200, -1, {0, 0, 1}),
                                              flat_corner(-1, 200, {0, 0, 1})};
    for (auto& corner : corners) corner.position.z += 1000.0F * static_cast<float>(chart);
    maker.add(corners);
  }
  for (std::size_t i = 0; i < maker.block.owner.size(); ++i)  // interleaved texel by texel
    maker.block.owner[i] = static_cast<std::uint16_t>((i + i / 64) % charts);
  const Packets out = checked_packets(TargetBlock(maker.block, kImage, 1e-6F));
  CHECK(out.groups.size() == 64 * std::min(charts, 4U));
  if (charts > 4) return;
  for (const PacketGroup& group : out.groups) {
    const float z = out.packets[group.first].pz[0];
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      for (const float lane_z : out.packets[p].pz) CHECK(lane_z == z);
    }
  }
}

namespace {

/// The groups of a block by their definition: of each window, texel by texel, those within sixteen
/// edges of the first one that is left, three times; then the rest.
std::vector<std::vector<std::uint32_t>> groups_one_by_one(const TargetBlock& map) {
  std::vector<std::vector<std::uint32_t>> groups;
  for (std::uint32_t w = 0; w < 64; ++w) {
    std::vector<std::uint32_t> rest;
    for (std::uint32_t i = 0; i < 64; ++i) {  // in quarters of 4x4
      const std::uint32_t x = w % 8 * 8 + i / 16 % 2 * 4 + i % 4;
      const std::uint32_t y = w / 8 * 8 + i / 32 * 4 + i % 16 / 4;
      if (map.covered(y * 64 + x)) rest.push_back(y * 64 + x);
    }
    for (int cluster = 1; !rest.empty(); ++cluster) {
      const TargetBlock::Texel seed = map.texel(rest[0]);
      std::vector<std::uint32_t> near, far;
      for (const std::uint32_t texel : rest) {
        const TargetBlock::Texel other = map.texel(texel);
        const Vec3f d = other.position - seed.position;
        const float spread = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
        const bool is_near = spread * std::min(seed.per_texel, other.per_texel) <= 16;
        (is_near || cluster == 4 ? near : far).push_back(texel);
      }
      groups.push_back(near);
      rest = far;
    }
  }
  return groups;
}

}  // namespace

TEST_CASE("groups are what texels one by one say, wherever their triangles reach") {
  Random random(77);
  std::size_t whole = 0, cut = 0;
  for (int round = 0; round < 60; ++round) {
    BlockMaker maker(0, 0);
    const std::uint64_t triangles = 1 + random.below(12);
    const float apart = random.between(0.0F, 12.0F), tilt = random.between(0.0F, 120.0F);
    for (std::uint64_t t = 0; t < triangles; ++t) {
      std::array<BlockMaker::Corner, 3> corners{flat_corner(-1, -1, {0, 0, 1}),
                                                flat_corner(200, -1, {0, 0, 1}),
                                                flat_corner(-1, 200, {0, 0, 1})};
      for (auto& corner : corners)
        corner.position.z += apart * static_cast<float>(t) + tilt * random.between(-1.0F, 1.0F);
      maker.add(corners);
    }
    std::uint16_t owner = 0;
    for (auto& texel : maker.block.owner) {
      if (random.one_in(4)) owner = static_cast<std::uint16_t>(random.below(triangles));
      texel = random.one_in(500) ? store::kNoTriangle : owner;
    }
    const TargetBlock map(maker.block, kImage, 1e-6F);
    const Packets out = checked_packets(map);
    const auto expected = groups_one_by_one(map);
    REQUIRE(out.groups.size() == expected.size());
    for (std::size_t g = 0; g < expected.size(); ++g) {
      std::vector<std::uint32_t> texels;
      for (std::uint32_t p = 0; p < out.groups[g].count; ++p) {
        for (const std::uint16_t texel : out.packets[out.groups[g].first + p].texel)
          if (texel != kNoTexel) texels.push_back(texel);
      }
      CHECK(texels == expected[g]);
    }
    whole += expected.size() == 64 ? 1U : 0U;
    cut += expected.size() > 64 ? 1U : 0U;
  }
  CHECK(whole > 5);
  CHECK(cut > 5);
}

TEST_CASE("rays start inside of the triangle that owns their texel, by the inset or its middle") {
  Random random(33);
  std::size_t moved = 0, kept = 0;
  for (int round = 0; round < 60; ++round) {
    BlockMaker maker(0, 0);
    const bool on_grid = random.one_in(2);  // corners on texel centres: centres on edges
    for (int i = 0; i < 6; ++i) {
      const auto corner = [&] {
        const double x = random.between(-9.0, 73.0), y = random.between(-9.0, 73.0);
        return flat_corner(on_grid ? std::round(x) : x, on_grid ? std::round(y) : y, {0, 0, 1});
      };
      maker.add({corner(), corner(), corner()});
    }
    const TargetBlock plain(maker.block, kImage, 1e-6F),
        map(maker.block, kImage, 1e-6F, TargetBlock::Start::inset);
    PageVector<TexelPacket> packets;
    std::vector<PacketGroup> groups;
    map.make_packets(0, packets, groups);
    for (const TexelPacket& packet : packets) {
      const float step = step_of(packet);
      REQUIRE(step == 0x1p-15F);  // coordinates reach 64 to 127; 32 steps are 0.001 units
      bool any = false;
      for (int lane = 0; lane < kLanes; ++lane) {
        const Vec3f start{packet.px[lane], packet.py[lane], packet.pz[lane]};
        if (packet.texel[lane] == kNoTexel) {
          CHECK(start == Vec3f{packet.px[0], packet.py[0], packet.pz[0]});
          continue;
        }
        const Vec3f back = Vec3f{static_cast<float>(packet.inset_x[lane]),
                                 static_cast<float>(packet.inset_y[lane]),
                                 static_cast<float>(packet.inset_z[lane])} *
                           step;
        CHECK(start - back == plain.texel(packet.texel[lane]).position);
        any = any || back != Vec3f{};
        const auto corners =
            maker.block.texel_corners(kImage, maker.block.owner[packet.texel[lane]]);
        // flat_corner(), turned around
        const Vec2d at{double{start.x} * 2, (100 - double{start.y}) * 4};
        const double area = mesh::doubled_area(corners[0], corners[1], corners[2]);
        double around = 0, nearest = 1e9;
        for (std::size_t k = 0; k < 3; ++k) {
          const Vec2d a = corners[k], b = corners[(k + 1) % 3];
          const double size = std::hypot(b.x - a.x, b.y - a.y);
          around += size;
          nearest = std::min(nearest, mesh::doubled_area(a, b, at) / size * (area < 0 ? -1 : 1));
        }
        const double wanted =
            std::min(32 * double{step} / std::sqrt(0.5 * 0.25), std::abs(area) / around);
        const double loss = 4 * double{step};  // half a step each way, in texels
        if (nearest < -loss) FAIL("a ray starts outside by " << -nearest);
        back == Vec3f{} ? ++kept : ++moved;
        if (back == Vec3f{}) CHECK(nearest > wanted - loss);
        CHECK(std::hypot(back.x * 2, back.y * 4) <= 2 * wanted + loss);
      }
      CHECK(packet.is_inset >= any);
    }
  }
  CHECK(moved > 300);
  CHECK(kept > 10000);
}

TEST_CASE("texel boxes hold every texel of their triangle and no more, and none is empty") {
  Random random(32);
  BlockMaker maker(0, 0);
  for (int i = 0; i < 20; ++i) {
    const auto corner = [&] {
      BlockMaker::Corner c =
          flat_corner(random.between(-9.0, 73.0), random.between(-9.0, 73.0), {0, 0, 1});
      c.position.z = random.between(-5.0F, 5.0F);
      return c;
    };
    maker.add({corner(), corner(), corner()});
  }
  const TargetBlock map(maker.block, kImage, 1e-30F);
  std::map<std::uint16_t, Box3f> expected;
  for (const std::uint32_t texel : covered(map))
    expected[maker.block.owner[texel]].extend(map.texel(texel).position);
  const auto boxes = texel_boxes(maker.block, kImage);
  REQUIRE(boxes.size() == expected.size());
  std::size_t i = 0;
  for (const auto& [triangle, box] : expected) {
    CHECK(!boxes[i].empty());
    const float slack = 1e-4F;  // a row's inner texels may round beyond its ends
    const auto holds = [slack](const Box3f& outer, const Box3f& inner) {
      const Box3f grown = outer.grown(slack);
      return grown.lo.x <= inner.lo.x && grown.lo.y <= inner.lo.y && grown.lo.z <= inner.lo.z &&
             grown.hi.x >= inner.hi.x && grown.hi.y >= inner.hi.y && grown.hi.z >= inner.hi.z;
    };
    CHECK(holds(boxes[i], box));
    CHECK(holds(box, boxes[i]));
    ++i;
  }
}

namespace {

/// A bent and uneven surface of small triangles that fills a block, and one of no area.
BlockMaker dense_block(Random& random, float size, Vec3f at) {
  BlockMaker maker(1, 1);
  constexpr int kCells = 30;
  std::vector<BlockMaker::Corner> corners;
  for (int j = 0; j <= kCells; ++j) {
    for (int i = 0; i <= kCells; ++i) {
      const bool inner = i > 0 && i < kCells && j > 0 && j < kCells;
      const double x = 64 + (i + (inner ? random.between(-0.4, 0.4) : 0)) * 63.0 / kCells;
      const double y = 64 + (j + (inner ? random.between(-0.4, 0.4) : 0)) * 63.0 / kCells;
      const Vec3f bump{0, 0, random.between(-0.3F, 0.3F)};
      Vec3f normal{random.between(-0.2F, 0.2F), random.between(-0.2F, 0.2F), 1};
      normal = normal * (1 / length(normal));
      const Vec3f flat{static_cast<float>(x - 64), static_cast<float>(y - 64), 0};
      corners.push_back({{x, y}, at + (flat + bump) * size, normal});
    }
  }
  const auto corner = [&](int i, int j) {
    return corners[static_cast<std::size_t>(j * (kCells + 1) + i)];
  };
  for (int j = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      maker.add({corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)});
      maker.add({corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)});
    }
  }
  maker.add({corner(0, 0), corner(0, 0), corner(0, 0)});
  return maker;
}

struct Start {
  Vec3f at, own;
  float coarseness = 0;
};

/// By texel: where its ray starts, and its own point.
std::map<std::uint32_t, Start> starts(const TargetBlock& map) {
  PageVector<TexelPacket> packets;
  std::vector<PacketGroup> groups;
  map.make_packets(0, packets, groups);
  std::map<std::uint32_t, Start> all;
  for (const TexelPacket& p : packets) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (p.texel[lane] == kNoTexel) continue;
      const Vec3f inset{static_cast<float>(p.inset_x[lane]), static_cast<float>(p.inset_y[lane]),
                        static_cast<float>(p.inset_z[lane])};
      const Vec3f at{p.px[lane], p.py[lane], p.pz[lane]};
      all[p.texel[lane]] = {at, at - inset * step_of(p), p.coarseness};
    }
  }
  return all;
}

}  // namespace

TEST_CASE("records say the same as their triangles, to a 2000th of a texel") {
  Random random(34);
  const float size = GENERATE(1.0F, 1e-6F, 1e6F);
  const BlockMaker maker = dense_block(random, size, Vec3f{40, -70, 10} * size);
  const TargetBlock exact(maker.block, kImage, 1e-30F, TargetBlock::Start::inset);
  const auto records = exact.as_records(maker.block);
  REQUIRE(records);
  CHECK(records->triangles.empty());
  const TargetBlock map(*records, kImage, 1e-30F, TargetBlock::Start::inset);
  checked_packets(TargetBlock(*records, kImage, 1e-30F));
  CHECK(covered(map) == covered(exact));
  const auto mine = starts(map);
  std::size_t moved = 0;
  for (const std::uint32_t t : covered(exact)) {
    const TargetBlock::Texel a = exact.texel(t), b = map.texel(t);
    const float edge = 1 / a.per_texel;
    CHECK(length(a.position - b.position) < edge / 2000);
    CHECK(length(a.normal - b.normal) < 7e-5F);
    CHECK(std::abs(b.per_texel * edge - 1) < 1.0F / 256);
    const Start& start = mine.at(t);
    CHECK(start.own == b.position);
    CHECK(length(start.at - start.own) < edge / 16);
    moved += start.at == start.own ? 0 : 1;
  }
  CHECK(moved > 20);
}

TEST_CASE("rays of records start inside of the triangle that owned their texel") {
  Random random(35);
  BlockMaker maker = dense_block(random, 1, {40, -70, 10});
  for (auto& p : maker.block.positions) p.z = 10;  // flat: inside or not is seen in the plane
  const TargetBlock exact(maker.block, kImage, 1e-30F, TargetBlock::Start::inset);
  const auto records = exact.as_records(maker.block);
  REQUIRE(records);
  for (const auto& [texel, start] :
       starts(TargetBlock(*records, kImage, 1e-30F, TargetBlock::Start::inset))) {
    const auto& triangle = maker.block.triangles[maker.block.owner[texel]];
    std::array<Vec2d, 3> c;
    for (std::size_t k = 0; k < 3; ++k)
      c[k] = {maker.block.positions[triangle[k]].x, maker.block.positions[triangle[k]].y};
    const double area = mesh::doubled_area(c[0], c[1], c[2]);
    for (std::size_t k = 0; k < 3; ++k) {
      const double inside = mesh::doubled_area(c[k], c[(k + 1) % 3], {start.at.x, start.at.y});
      const double side = std::hypot(c[k].x - c[(k + 1) % 3].x, c[k].y - c[(k + 1) % 3].y);
      CHECK(inside / side * (area < 0 ? -1 : 1) > 2 * records->step);
    }
  }
}

TEST_CASE(
    "a block keeps its triangles where one far out makes the steps too coarse for the others") {
  Random random(36);
  BlockMaker maker = dense_block(random, 1e-3F, {});
  CHECK(
      TargetBlock(maker.block, kImage, 1e-30F, TargetBlock::Start::inset).as_records(maker.block));
  maker.block.owner[0] = static_cast<std::uint16_t>(maker.block.triangles.size());
  const Vec3f up{0, 0, 1};
  maker.add({BlockMaker::Corner{{63, 63}, {9e4F, 0, 0}, up},
             BlockMaker::Corner{{65, 63}, {9e4F, 9e4F, 0}, up},
             BlockMaker::Corner{{63, 65}, {9e4F, 0, 9e4F}, up}});
  CHECK_FALSE(
      TargetBlock(maker.block, kImage, 1e-30F, TargetBlock::Start::inset).as_records(maker.block));
}
