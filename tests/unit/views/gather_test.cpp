// SPDX-License-Identifier: Apache-2.0
#include "views/gather.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <vector>

#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::views;

namespace {

/// A tile of the scene and one of the target, of one value each.
struct Tiles {
  std::vector<std::uint16_t> scene, target;
  ViewTiles view;

  Tiles(std::uint32_t x, std::uint32_t y, std::vector<std::uint16_t> samples,
        std::uint16_t target_depth)
      : target(kStoredEdge * kStoredEdge, target_depth) {
    for (int i = 0; i < kStoredEdge * kStoredEdge; ++i)
      scene.insert(scene.end(), samples.begin(), samples.end());
    view = {x, y, scene.data(), target.data()};
  }
  std::uint16_t& at(int x, int y, std::size_t sample) {
    return scene[((y + kApron) * kStoredEdge + x + kApron) * kSceneSamples + sample];
  }
};

/// One texel in the first lane that faces the eye of `view` at this cosine, so many pixels from the
/// upper left one of the tile and at this depth.
TexelPacket texel(const Grid& grid, std::uint32_t view, std::uint32_t tile, float x, float y,
                  float depth, float cosine) {
  TexelPacket packet{};
  for (int lane = 0; lane < kLanes; ++lane) packet.texel[lane] = surface::kNoTexel;
  const Frame& f = grid.frame(view);
  const float middle = static_cast<float>(grid.edge() / 2) - 0.5F,
              first = static_cast<float>(tile * kTileEdge);
  const Vec3f at = grid.middle() + f.right * ((first + x - middle) * grid.pixel()) +
                   f.down * ((first + y - middle) * grid.pixel()) +
                   f.forward * ((depth - kMostDepth / 2) * grid.depth_step());
  const Vec3f normal = f.forward * -cosine + f.right * std::sqrt(1 - cosine * cosine);
  packet.px[0] = at.x, packet.py[0] = at.y, packet.pz[0] = at.z;
  packet.nx[0] = normal.x, packet.ny[0] = normal.y, packet.nz[0] = normal.z;
  packet.texel[0] = 0;
  return packet;
}

const Grid& grid() {
  static const Grid made({{-1, -1, -1}, {1, 1, 1}}, 1 / 64.0F, 24);
  return made;
}
constexpr std::uint32_t kView = 5, kTile = 2;
constexpr std::uint16_t kAt = 30000;
constexpr SightLimits kLimits{100, 300};

void look(const TexelPacket& packet, const Tiles& tiles, SightPacket& sight,
          std::uint32_t view = kView) {
  std::vector<PlacePacket> places;
  place(grid(), view, view_kernels(""), {&packet, 1}, places, {&sight, 1});
  view_kernels("").gather(kLimits, tiles.view, places, {&sight, 1});
}

}  // namespace

TEST_CASE("a texel has the colour between four pixels", "[views]") {
  const TexelPacket packet = texel(grid(), kView, kTile, 10.25F, 20.5F, kAt, 0.8F);
  Tiles tiles(kTile, kTile, {1000, 2000, 3000, 65535, kAt}, kAt);
  tiles.at(11, 20, 0) = 5000;
  tiles.at(10, 21, 1) = 6000;
  SightPacket sight{};
  look(packet, tiles, sight);
  const auto found = sights_of(grid(), kLimits, sight)[0];
  REQUIRE(found);
  CHECK(found->colour[0] * 8191 == Approx(1000 + 4000 * 0.25 * 0.5).margin(3));
  CHECK(found->colour[1] * 8191 == Approx(2000 + 4000 * 0.75 * 0.5).margin(6));
  CHECK(found->colour[2] * 8191 == Approx(3000).margin(1));
  CHECK(found->opacity == 1);
  CHECK(found->distance == Approx(0).margin(grid().depth_step()));
  CHECK(sight.clear.weight[0] == 163);  // 0.64 * 255
  CHECK(sight.facing[0] == 163);
  for (int lane = 1; lane < kLanes; ++lane)
    CHECK_FALSE(sights_of(grid(), kLimits, sight)[static_cast<std::size_t>(lane)]);
}

TEST_CASE("colours count by their alpha, and half of it is asked for", "[views]") {
  const TexelPacket packet = texel(grid(), kView, kTile, 10.5F, 20, kAt, 1);
  Tiles tiles(kTile, kTile, {1000, 1000, 1000, 65535, kAt}, kAt);
  tiles.at(11, 20, 0) = 4000;
  tiles.at(11, 20, 3) = 21845;  // a third
  SightPacket sight{};
  look(packet, tiles, sight);
  CHECK(sights_of(grid(), kLimits, sight)[0]->colour[0] * 8191 ==
        Approx((3 * 1000 + 4000) / 4.0).margin(6));
  CHECK(sights_of(grid(), kLimits, sight)[0]->opacity == Approx(2.0 / 3).margin(1e-3));
  SightPacket faint{};
  look(packet, Tiles(kTile, kTile, {1000, 1000, 1000, 32000, kAt}, kAt), faint);
  CHECK_FALSE(sights_of(grid(), kLimits, faint)[0]);
  CHECK(faint.facing[0] == 255);
}

TEST_CASE("what is not where the target is first met is not seen", "[views]") {
  const Tiles tiles(kTile, kTile, {1000, 1000, 1000, 65535, kAt}, kAt);
  const auto seen = [&](float depth, float cosine) {
    SightPacket sight{};
    look(texel(grid(), kView, kTile, 10, 20, depth, cosine), tiles, sight);
    return sights_of(grid(), kLimits, sight)[0].has_value();
  };
  CHECK(seen(kAt + 98, 1));
  CHECK(seen(kAt - 98, 1));
  CHECK_FALSE(seen(kAt + 102, 1));
  CHECK_FALSE(seen(kAt - 102, 1));
  CHECK(seen(kAt, 0.11F));
  CHECK_FALSE(seen(kAt, 0.09F));
  CHECK_FALSE(seen(kAt, -0.5F));
  SightPacket sight{};
  look(texel(grid(), kView, kTile, 10, 20, kAt, 1),
       Tiles(kTile, kTile, {1000, 1000, 1000, 65535, kAt}, kNoDepth), sight);
  CHECK_FALSE(sights_of(grid(), kLimits, sight)[0]);
  // Another tile's texels are left to it.
  look(texel(grid(), kView, kTile, 64, 20, kAt, 1), tiles, sight);
  look(texel(grid(), kView, kTile, -1, 20, kAt, 1), tiles, sight);
  CHECK_FALSE(sights_of(grid(), kLimits, sight)[0]);
  look(texel(grid(), kView, kTile, 63.5F, 20, kAt, 1), tiles, sight);
  CHECK(sights_of(grid(), kLimits, sight)[0]);
}

TEST_CASE("a view that the scene hides counts where no other does", "[views]") {
  const TexelPacket packet = texel(grid(), kView, kTile, 10, 20, kAt, 1);
  const Tiles hidden(kTile, kTile, {4000, 0, 0, 65535, kAt - 301}, kAt),
      clear(kTile, kTile, {0, 4000, 0, 65535, kAt - 150}, kAt);
  SightPacket sight{};
  look(packet, hidden, sight);
  const auto alone = sights_of(grid(), kLimits, sight)[0];
  REQUIRE(alone);
  CHECK(alone->colour[0] * 8191 == Approx(4000).margin(1));
  CHECK(alone->distance == Approx(301 * grid().depth_step()).epsilon(0.01));
  look(packet, clear, sight);
  const auto both = sights_of(grid(), kLimits, sight)[0];
  CHECK(both->colour[0] == 0);
  CHECK(both->colour[1] * 8191 == Approx(4000).margin(1));
  CHECK(both->distance == Approx(150 * grid().depth_step()).epsilon(0.01));
  // It knows better where it is, and more of what it faces sees it.
  CHECK(both->confidence > alone->confidence);
  SightPacket at_place{};
  look(packet, Tiles(kTile, kTile, {0, 4000, 0, 65535, kAt}, kAt), at_place);
  CHECK(sights_of(grid(), kLimits, at_place)[0]->confidence == Approx(1));
}

TEST_CASE("views are weighed by the square of the cosine", "[views]") {
  TexelPacket packet = texel(grid(), kView, kTile, 10, 20, kAt, 1);
  const Tiles red(kTile, kTile, {8000, 0, 0, 65535, kAt}, kAt),
      blue(kTile, kTile, {0, 0, 8000, 65535, kAt}, kAt);
  SightPacket sight{};
  look(packet, red, sight);
  const TexelPacket aside = texel(grid(), kView, kTile, 10, 20, kAt, 0.5F);
  look(aside, blue, sight);
  const auto found = sights_of(grid(), kLimits, sight)[0];
  CHECK(found->colour[0] * 8191 == Approx(8000 * 255.0 / (255 + 64)).margin(2));
  CHECK(found->colour[2] * 8191 == Approx(8000 * 64.0 / (255 + 64)).margin(2));
}

TEST_CASE("views that disagree are trusted less", "[views]") {
  const TexelPacket packet = texel(grid(), kView, kTile, 10, 20, kAt, 1);
  const auto seen = [&](std::uint16_t first, std::uint16_t second) {
    SightPacket sight{};
    for (const std::uint16_t grey : {first, second})
      look(packet, Tiles(kTile, kTile, {grey, grey, grey, 65535, kAt}, kAt), sight);
    return sights_of(grid(), kLimits, sight)[0]->confidence;
  };
  CHECK(seen(4000, 4000) == Approx(1));
  // Greys of 125 and 151 of 255: 13 from their mean.
  CHECK(seen(4016, 4850) == Approx(0.1 + 0.9 / (1 + std::pow(13 / (0.05 * 255), 2))));
  CHECK(seen(9000, 9000) == Approx(1));  // brighter than white, as bright as white
}

TEST_CASE("kernels see the same bits, lane by lane", "[views]") {
  // Sixteen texels across a corner of the tile, on and off the target, before and behind the scene.
  Tiles tiles(kTile, kTile, {0, 0, 0, 65535, kAt}, kAt);
  test::Random random(1);
  const auto depth = [&](int low, int high) {
    return random.one_in(9) ? kNoDepth : static_cast<std::uint16_t>(kAt + random.whole(low, high));
  };
  for (std::size_t i = 0; i < tiles.scene.size(); ++i) {
    const std::size_t sample = i % kSceneSamples;
    tiles.scene[i] = sample == 4
                         ? depth(-400, 600)
                         : static_cast<std::uint16_t>(random.whole(sample == 3 ? 20000 : 0, 52000));
  }
  for (std::uint16_t& target : tiles.target) target = depth(-80, 48);
  std::vector<PlacePacket> places(40);
  for (PlacePacket& place : places) {
    place.tiles = {kTile, kTile, kTile, kTile};
    place.alike = 1;
    for (int lane = 0; lane < kLanes; ++lane) {
      place.x[lane] = kTile * kTileEdge + random.between(-2.0F, 66.0F);
      place.y[lane] = kTile * kTileEdge + random.between(-2.0F, 66.0F);
      place.depth[lane] = kAt + random.between(-50.0F, 50.0F);
      place.cosine[lane] = random.between(0.0F, 1.0F);
      place.weight[lane] = static_cast<std::int32_t>(random.one_in(5) ? 0 : random.whole(1, 255));
    }
  }
  // Lane by lane, in plain code.
  std::vector<SightPacket> expected(places.size());
  const auto whole = [](float value) { return static_cast<std::int32_t>(value + 0.5F); };
  std::size_t counted = 0, hidden = 0;
  for (std::size_t p = 0; p < places.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const PlacePacket& at = places[p];
      const float x = at.x[lane] - kTile * kTileEdge, y = at.y[lane] - kTile * kTileEdge;
      if (at.weight[lane] == 0 || x < 0 || y < 0 || x >= kTileEdge || y >= kTileEdge) continue;
      const int ix = static_cast<int>(x), iy = static_cast<int>(y);
      const float fx = at.x[lane] -
                       static_cast<float>(kTile * kTileEdge + static_cast<std::uint32_t>(ix)),
                  fy = at.y[lane] -
                       static_cast<float>(kTile * kTileEdge + static_cast<std::uint32_t>(iy));
      bool on = false;
      float sum[3] = {}, alpha = 0, before = -1e30F, depths = 0, shares = 0;
      for (int k = 0; k < 4; ++k) {
        const float share = (k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy);
        const auto pixel =
            static_cast<std::size_t>((iy + k / 2 + kApron) * kStoredEdge + ix + k % 2 + kApron);
        const float target = tiles.target[pixel];
        on = on || (target != kNoDepth && std::abs(target - at.depth[lane]) <= kLimits.on_target);
        const std::uint16_t* const s = &tiles.scene[pixel * kSceneSamples];
        for (int c = 0; c < 3; ++c) sum[c] += share * s[3] * s[c];
        alpha += share * s[3];
        if (s[4] == kNoDepth) continue;
        before = std::max(before, at.depth[lane] - s[4]);
        depths += share * s[4];
        shares += share;
      }
      if (!on || alpha < 0.5F * 65535) continue;
      SightPacket::Sums& sums = before > kLimits.hidden ? expected[p].hidden : expected[p].clear;
      ++(before > kLimits.hidden ? hidden : counted);
      const std::int32_t w = at.weight[lane];
      sums.weight[lane] += w;
      float colour[3];
      for (int c = 0; c < 3; ++c) {
        colour[c] = sum[c] * (1 / alpha);
        sums.colour[c][lane] += w * whole(colour[c]);
      }
      sums.alpha[lane] += w * whole(std::min(alpha, 65535.0F));
      const std::int32_t luma =
          whole(std::min((colour[0] + 2 * colour[1] + colour[2]) * (255 / (4 * 8191.0F)), 255.0F));
      sums.luma[lane] += w * luma;
      sums.luma_squares[lane] += w * luma * luma;
      if (!(shares > 0)) continue;
      const float away = at.depth[lane] - depths / shares, outside = away * at.cosine[lane];
      sums.away[lane] += w * static_cast<std::int32_t>(outside + (outside < 0 ? -0.5F : 0.5F));
      sums.off[lane] += w * whole(std::abs(away));
    }
  }
  CHECK(counted > 50);
  CHECK(hidden > 50);
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const ViewKernels* kernels = nullptr;
    if (test::error_kind([&] { kernels = &view_kernels(isa); }) != 0) continue;
    CAPTURE(isa);
    std::vector<SightPacket> found(places.size());
    kernels->gather(kLimits, tiles.view, places, found);
    CHECK(std::memcmp(found.data(), expected.data(), found.size() * sizeof found[0]) == 0);
    // Where nobody asks for the confidence, all else is the same.
    std::vector<SightPacket> unsure(places.size()), none_of_it = expected;
    for (SightPacket& packet : none_of_it) {
      for (SightPacket::Sums* sums : {&packet.clear, &packet.hidden}) {
        for (auto* of_confidence : {&sums->off, &sums->luma, &sums->luma_squares})
          std::memset(of_confidence, 0, sizeof *of_confidence);
      }
    }
    SightLimits limits = kLimits;
    limits.tells_confidence = false;
    kernels->gather(limits, tiles.view, places, unsure);
    CHECK(std::memcmp(unsure.data(), none_of_it.data(), unsure.size() * sizeof unsure[0]) == 0);
    for (std::size_t p = 0; p < places.size(); ++p) {
      const auto sure = sights_of(grid(), kLimits, expected[p]),
                 less = sights_of(grid(), limits, unsure[p]);
      REQUIRE(sure.found == less.found);
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        if (!sure.has(lane)) continue;
        CHECK(sure[lane]->colour == less[lane]->colour);
        CHECK(sure[lane]->opacity == less[lane]->opacity);
        CHECK(sure[lane]->distance == less[lane]->distance);
        CHECK(sure[lane]->confidence >= kLeastConfidence);
        CHECK(less[lane]->confidence == kLeastConfidence);
      }
    }
    // Without the scene it is known which packets would find nothing.
    ViewTiles target = tiles.view;
    target.scene = nullptr;
    for (std::size_t p = 0; p < places.size(); ++p) {
      const SightPacket none{};
      if (!kernels->sees(kLimits, target, {&places[p], 1}))
        CHECK(std::memcmp(&expected[p], &none, sizeof none) == 0);
    }
    CHECK(kernels->sees(kLimits, target, places));
    CHECK_FALSE(kernels->sees({}, target, places));
    ++target.tile_x;
    CHECK_FALSE(kernels->sees(kLimits, target, places));
  }
}

TEST_CASE("packets know their tiles, and those behind that lie in the same", "[views]") {
  // Groups of packets from one place each; lanes are strewn, or look away.
  test::Random random(7);
  std::vector<TexelPacket> packets;
  while (packets.size() < 400) {
    const float spread = random.one_in(4) ? 0.5F : 0.02F;
    const Vec3f at{random.between(-0.8F, 0.8F), random.between(-0.8F, 0.8F),
                   random.between(-0.8F, 0.8F)};
    const bool flat = random.one_in(2);
    for (auto left = random.whole(1, 12); left > 0; --left) {
      TexelPacket& packet = packets.emplace_back();
      for (int lane = 0; lane < kLanes; ++lane) {
        packet.px[lane] = at.x + random.between(-spread, spread);
        packet.py[lane] = at.y + random.between(-spread, spread);
        packet.pz[lane] = at.z + random.between(-spread, spread);
        const bool along_x = flat || random.one_in(2);
        (along_x ? packet.nx : packet.nz)[lane] = flat || random.one_in(2) ? 1.0F : -1.0F;
      }
    }
  }
  std::size_t empty = 0, wide = 0, runs = 0;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const ViewKernels* kernels = nullptr;
    if (test::error_kind([&] { kernels = &view_kernels(isa); }) != 0) continue;
    CAPTURE(isa);
    for (std::uint32_t view = 0; view < 24; view += 5) {
      std::vector<PlacePacket> places;
      std::vector<SightPacket> sights(packets.size());
      place(grid(), view, *kernels, packets, places, sights);
      std::vector<TileRange> expected;
      for (const PlacePacket& own : places) {
        TileRange& range = expected.emplace_back();
        for (int lane = 0; lane < kLanes; ++lane) {
          if (own.weight[lane] == 0) continue;
          const auto x = static_cast<std::uint16_t>(own.x[lane] / kTileEdge),
                     y = static_cast<std::uint16_t>(own.y[lane] / kTileEdge);
          if (range.empty()) range = {x, x, y, y};
          range = {std::min(range.x0, x), std::max(range.x1, x), std::min(range.y0, y),
                   std::max(range.y1, y)};
        }
        empty += range.empty() ? 1 : 0;
        wide += range.x1 > range.x0 && range.y1 > range.y0 ? 1 : 0;
      }
      for (std::size_t p = 0; p < places.size(); ++runs) {
        const std::size_t end = p + places[p].alike;
        REQUIRE(end > p);
        REQUIRE(end <= places.size());
        for (std::size_t i = p; i < end; ++i) CHECK(places[i].tiles == expected[p]);
        for (std::size_t i = p; i < end; ++i) CHECK(expected[i] == expected[p]);
        if (end < places.size()) CHECK_FALSE(expected[end] == expected[p]);
        p = end;
      }
    }
  }
  CHECK(empty > 100);
  CHECK(wide > 100);
  CHECK(runs > 100);
}

TEST_CASE("kernels place texels at the same bits", "[views]") {
  std::vector<PlacePacket> expected, found;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const ViewKernels* kernels = nullptr;
    if (test::error_kind([&] { kernels = &view_kernels(isa); }) != 0) continue;
    for (std::uint32_t view = 0; view < 24; ++view) {
      TexelPacket packet = texel(grid(), kView, kTile, 10.3F, 20.7F, kAt, 0.7F);
      for (int lane = 1; lane < kLanes; ++lane) {
        packet.px[lane] = packet.px[0] + 0.013F * static_cast<float>(lane);
        packet.py[lane] = packet.py[0] - 0.007F * static_cast<float>(lane);
        packet.pz[lane] = packet.pz[0];
        packet.nx[lane] = packet.ny[0];
        packet.ny[lane] = packet.nz[0];
        packet.nz[lane] = packet.nx[0];
      }
      SightPacket sight{};
      place(grid(), view, *kernels, {&packet, 1}, found, {&sight, 1});
      if (expected.size() <= view) expected.push_back(found[0]);
      const PlacePacket &a = expected[view], &b = found[0];
      CHECK(std::memcmp(a.cosine, b.cosine, sizeof a.cosine) == 0);
      CHECK(a.tiles.empty() == b.tiles.empty());
      if (a.tiles.empty()) continue;
      CHECK(std::memcmp(a.x, b.x, sizeof a.x) == 0);
      CHECK(std::memcmp(a.y, b.y, sizeof a.y) == 0);
      CHECK(std::memcmp(a.depth, b.depth, sizeof a.depth) == 0);
      CHECK(std::memcmp(a.weight, b.weight, sizeof a.weight) == 0);
      CHECK(std::memcmp(&a.tiles, &b.tiles, sizeof a.tiles) == 0);
    }
  }
}
