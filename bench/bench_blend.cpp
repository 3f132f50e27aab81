// SPDX-License-Identifier: Apache-2.0
#include <random>

#include "bench_input.h"
#include "projection/blend.h"
#include "shading/result_block.h"

namespace pounce::bench {
namespace {

constexpr std::size_t kPlaces = 4096;

std::vector<Vec2d> random_places() {
  std::mt19937 random(1);
  std::vector<Vec2d> places;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    const auto next = [&] {
      return static_cast<double>(random()) * mesh::kBlockEdge / 4294967296.0;
    };
    const double x = next();
    places.push_back({x, next()});
  }
  return places;
}

/// Weights and blend at random places of one tile. Per target texel.
class BlendInput {
 public:
  explicit BlendInput(Depth depth) : places(random_places()) {
    image.width = image.height = mesh::kBlockEdge;
    image.channels = 3;
    image.depth = depth;
    image.linear = depth == Depth::half;
    // Bytes below 0x3C make finite halves, too.
    std::mt19937 random(2);
    tile.resize(std::size_t{store::kColourTileEdge} * store::kColourTileEdge * image.texel_bytes());
    for (std::byte& byte : tile) byte = static_cast<std::byte>(random() % 0x3C);
  }
  template <class Blend>
  void run(benchmark::State& state, Blend&& blend) const {
    for (auto _ : state) {
      for (const Vec2d& place : places) {
        const auto column = static_cast<int>(place.x), row = static_cast<int>(place.y);
        projection::Taps taps;
        projection::tent(place.x - column, place.y - row, taps);
        blend(column, row, taps);
      }
    }
    count_work(state, "texel", static_cast<double>(kPlaces));
  }
  store::ColourDirectory image;
  std::vector<Vec2d> places;
  std::vector<std::byte> tile;
};

void blend_tent(benchmark::State& state, Depth depth) {
  const BlendInput input(depth);
  input.run(state, [&](int column, int row, const projection::Taps& taps) {
    benchmark::DoNotOptimize(projection::blend(input.image, input.tile.data(), column, row, taps,
                                               projection::BlendAlpha::straight));
  });
}
BENCHMARK_CAPTURE(blend_tent, rgb_u8, Depth::u8);
BENCHMARK_CAPTURE(blend_tent, rgb_u16, Depth::u16);
BENCHMARK_CAPTURE(blend_tent, rgb_half, Depth::half);

/// From 8 bits to 8 bits without a detour.
void blend_tent_u8(benchmark::State& state) {
  const BlendInput input(Depth::u8);
  std::array<std::byte, 4> out{};
  input.run(state, [&](int column, int row, const projection::Taps& taps) {
    projection::blend_u8(input.image, input.tile.data(), column, row, taps, out.data());
    benchmark::DoNotOptimize(out);
  });
}
BENCHMARK(blend_tent_u8);

/// A blended value into the output's format. Per target texel.
void blend_store(benchmark::State& state, bool from_linear) {
  shading::TexelFormat format;
  format.channels = 3;
  std::mt19937 random(3);
  std::vector<shading::TexelValue> values(kPlaces);
  for (shading::TexelValue& value : values) {
    value.channels = 3;
    value.linear = from_linear;
    for (std::size_t c = 0; c < 3; ++c) value.v[c] = static_cast<double>(random()) / 4294967296.0;
  }
  std::array<std::byte, 4> out{};
  for (auto _ : state) {
    for (const shading::TexelValue& value : values) {
      shading::store_texel(format, value, out.data());
      benchmark::DoNotOptimize(out);
    }
  }
  count_work(state, "texel", static_cast<double>(kPlaces));
}
BENCHMARK_CAPTURE(blend_store, u8_to_u8, false);
BENCHMARK_CAPTURE(blend_store, linear_to_u8, true);

}  // namespace
}  // namespace pounce::bench
