// SPDX-License-Identifier: Apache-2.0
//
// What a default job of equal sizes does to most of its texels: the mean of cubic lookups over a
// footprint.
#include <cmath>
#include <random>

#include "bench_input.h"
#include "projection/blend_lanes.h"

namespace pounce::bench {
namespace {

constexpr std::size_t kPackets = 256;
constexpr std::uint32_t kTilesAlong = 8;
constexpr auto kImageSize = kTilesAlong * std::uint32_t{mesh::kBlockEdge};
constexpr std::size_t kTileBytes = std::size_t{store::kColourTileEdge} * store::kColourTileEdge * 3;
/// No level beside the image itself: what equal sizes need.
constexpr std::uint32_t kLastLevel = 0;

/// Sixteen texels side by side, and what they cover.
struct Packet {
  std::array<projection::Footprint, surface::kLanes> footprints;
  std::array<Vec2d, surface::kLanes> middles;
};

/// An image in RGB of 8 bits and packets of 4 x 4 texels on it, turned somehow, 0.9 to 1.6 texels
/// of the image wide and high.
class FootprintInput {
 public:
  FootprintInput() : tiles_(kTilesAlong * kTilesAlong * kTileBytes) {
    image.width = image.height = kImageSize;
    image.channels = 3;
    for (std::byte& byte : tiles_) byte = static_cast<std::byte>(random_() & 255U);
    for (Packet& packet : packets_) fill(packet);
  }

  const std::byte* tile(std::uint32_t x, std::uint32_t y) const {
    return tiles_.data() + (std::size_t{y} * kTilesAlong + x) * kTileBytes;
  }
  const std::vector<Packet>& packets() const { return packets_; }
  store::ColourDirectory image;

 private:
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(random_()) / 4294967296.0;
  }

  void fill(Packet& packet) {
    const double turn = between(0, 6.2831853), wide = between(0.9, 1.6), high = between(0.9, 1.6);
    const Vec2d a{wide * std::cos(turn), wide * std::sin(turn)};
    const Vec2d b{-high * std::sin(turn), high * std::cos(turn)};
    const Vec2d first{between(8, kImageSize - 8), between(8, kImageSize - 8)};
    for (std::size_t lane = 0; lane < packet.middles.size(); ++lane) {
      const auto i = static_cast<double>(lane % 4), j = static_cast<double>(lane / 4);
      packet.footprints[lane] = {a, b};
      packet.middles[lane] = {first.x + i * a.x + j * b.x, first.y + i * a.y + j * b.y};
    }
  }

  std::mt19937 random_{1};
  std::vector<std::byte> tiles_;
  std::vector<Packet> packets_{kPackets};
};

/// One texel after the other, by the functions of one texel.
void add_one(const FootprintInput& input, const projection::Footprint& footprint, Vec2d middle,
             projection::Blended& mean) {
  const auto lookups = projection::lookups_of(footprint, kLastLevel);
  const projection::Lookups& set = lookups.sets[0];
  const double share = set.share / (set.count_a * set.count_b);
  for (int a = 0; a < set.count_a; ++a) {
    for (int b = 0; b < set.count_b; ++b) {
      const double i = a - 0.5 * (set.count_a - 1), j = b - 0.5 * (set.count_b - 1);
      const auto x = projection::placed(middle.x + (i * set.step_a.x + j * set.step_b.x),
                                        kImageSize, mesh::Wrap::repeat);
      const auto y = projection::placed(middle.y + (i * set.step_a.y + j * set.step_b.y),
                                        kImageSize, mesh::Wrap::repeat);
      const int tile_x = std::max(x.texel, 0) / mesh::kBlockEdge,
                tile_y = std::max(y.texel, 0) / mesh::kBlockEdge;
      projection::Taps taps;
      projection::cubic(x.rest, y.rest, taps);
      projection::sharpen(lookups.sharpening, x.rest, y.rest, taps);
      const auto samples = projection::blend(
          input.image,
          input.tile(static_cast<std::uint32_t>(tile_x), static_cast<std::uint32_t>(tile_y)),
          x.texel - tile_x * mesh::kBlockEdge, y.texel - tile_y * mesh::kBlockEdge, taps,
          projection::BlendAlpha::straight);
      for (std::size_t c = 0; c < mean.size(); ++c) mean[c] += share * samples[c];
    }
  }
}

void blend_footprints_one_by_one(benchmark::State& state) {
  const FootprintInput input;
  for (auto _ : state) {
    for (const Packet& packet : input.packets()) {
      for (std::size_t lane = 0; lane < packet.middles.size(); ++lane) {
        projection::Blended mean{};
        add_one(input, packet.footprints[lane], packet.middles[lane], mean);
        benchmark::DoNotOptimize(mean);
      }
    }
  }
  count_work(state, "texel", static_cast<double>(kPackets * surface::kLanes));
}
BENCHMARK(blend_footprints_one_by_one);

/// The same of sixteen texels at once, rounded to 8 bits.
void blend_footprints(benchmark::State& state, const char* isa) {
  const projection::BlendLanes* kernels = nullptr;
  try {
    kernels = &projection::blend_lanes(isa);
  } catch (const Error&) {
    state.SetLabel("skipped: this processor lacks it");
    for (auto _ : state) {
    }
    return;
  }
  const FootprintInput input;
  const double keys = projection::keys_of(projection::cubic);
  const projection::LookedUp in{kImageSize, kImageSize, kImageSize, kImageSize};
  const projection::Sixteen<std::int32_t> last_level{};
  projection::FootprintLanes footprints{};
  projection::Vec2Lanes middles{};
  projection::FootprintLookupsLanes lookups{};
  projection::PlacesLanes places{};
  projection::WeightsLanes weights{};
  projection::Sixteen<std::uint32_t> texels{};
  for (auto _ : state) {
    for (const Packet& packet : input.packets()) {
      for (std::size_t lane = 0; lane < packet.middles.size(); ++lane) {
        footprints.ax[lane] = packet.footprints[lane].a.x;
        footprints.ay[lane] = packet.footprints[lane].a.y;
        footprints.bx[lane] = packet.footprints[lane].b.x;
        footprints.by[lane] = packet.footprints[lane].b.y;
        middles.x[lane] = packet.middles[lane].x;
        middles.y[lane] = packet.middles[lane].y;
      }
      kernels->lookups(footprints, last_level, lookups);
      projection::MeansLanes means{};
      projection::for_each_lookup(
          *kernels, keys, lookups.sets[0], projection::sharpening_of(lookups, 0xFFFF), in, middles,
          0xFFFF, places, weights, [&] {
            projection::for_each_tile(
                places, [&](std::uint32_t x, std::uint32_t y) { return input.tile(x, y); },
                [&](const std::byte* tile, const auto& share, unsigned) {
                  kernels->add[0][2](tile, places, weights, share, means);
                });
          });
      kernels->round_means(means, 3, texels);
      benchmark::DoNotOptimize(texels);
    }
  }
  count_work(state, "texel", static_cast<double>(kPackets * surface::kLanes));
}
BENCHMARK_CAPTURE(blend_footprints, sse2, "sse2");
BENCHMARK_CAPTURE(blend_footprints, avx2, "avx2");
BENCHMARK_CAPTURE(blend_footprints, avx512, "avx512");

}  // namespace
}  // namespace pounce::bench
