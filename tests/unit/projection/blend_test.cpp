// SPDX-License-Identifier: Apache-2.0
#include "projection/blend.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "core/half.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::projection;
using mesh::Wrap;
using pounce::test::Random;

namespace {

constexpr int kEdge = store::kColourTileEdge;

struct Tile {
  store::ColourDirectory image;
  std::vector<std::byte> bytes;
  std::vector<double> samples;  ///< what they mean: 0..1 or the float itself

  double at(int column, int row, std::uint32_t channel) const {
    return samples[(static_cast<std::size_t>(row + store::kApron) * kEdge +
                    static_cast<std::size_t>(column + store::kApron)) *
                       image.channels +
                   channel];
  }
};

Tile random_tile(Random& random, Depth depth, std::uint32_t channels) {
  Tile tile;
  tile.image.width = tile.image.height = 64;
  tile.image.channels = channels;
  tile.image.depth = depth;
  const auto put = [&](auto value) {
    const auto* first = reinterpret_cast<const std::byte*>(&value);
    tile.bytes.insert(tile.bytes.end(), first, first + sizeof value);
  };
  for (std::uint32_t i = 0; i < kEdge * kEdge * channels; ++i) {
    if (depth == Depth::u8) {
      const auto v = static_cast<std::uint8_t>(random.bits());
      put(v);
      tile.samples.push_back(v / 255.0);
    } else if (depth == Depth::u16) {
      const auto v = static_cast<std::uint16_t>(random.bits());
      put(v);
      tile.samples.push_back(v / 65535.0);
    } else if (depth == Depth::half) {
      const std::uint16_t v = float_to_half(random.between(-4.0F, 4.0F));
      put(v);
      tile.samples.push_back(half_to_float(v));
    } else {
      const float v = random.between(-4.0F, 4.0F);
      put(v);
      tile.samples.push_back(v);
    }
  }
  return tile;
}

double bilinear(const Tile& tile, int column, int row, double u, double v, std::uint32_t c) {
  return (1 - v) * ((1 - u) * tile.at(column, row, c) + u * tile.at(column + 1, row, c)) +
         v * ((1 - u) * tile.at(column, row + 1, c) + u * tile.at(column + 1, row + 1, c));
}

}  // namespace

TEST_CASE("the tent's weights are those of bilinear interpolation in steps of 2^-20") {
  Taps taps;
  tent(0, 0, taps);
  CHECK(taps.first == 0);
  CHECK(taps.size == 2);
  CHECK((taps.weights[0] == 1 << 20 && taps.weights[1] == 0));
  CHECK((taps.weights[2] == 0 && taps.weights[3] == 0 && taps.total == 1 << 20));
  tent(0.25, 0.5, taps);
  CHECK(taps.weights[0] == 393216);  // 3/8
  CHECK(taps.weights[1] == 131072);  // 1/8
  CHECK(taps.weights[2] == 393216);
  CHECK(taps.weights[3] == 131072);
  Random random(71);
  for (int i = 0; i < 10000; ++i) {
    tent(random.unit(), random.unit(), taps);
    CHECK(taps.total >= (1 << 20) - 2);
    CHECK(taps.total <= (1 << 20) + 2);
    CHECK(taps.total == taps.weights[0] + taps.weights[1] + taps.weights[2] + taps.weights[3]);
  }
}

TEST_CASE("a blend is bilinear for every depth, exact at texel centres, and reads the apron") {
  Random random(72);
  for (const Depth depth : {Depth::u8, Depth::u16, Depth::half, Depth::float32}) {
    for (std::uint32_t channels = 1; channels <= 4; ++channels) {
      const Tile tile = random_tile(random, depth, channels);
      double worst = 0;
      for (int i = 0; i < 3000; ++i) {
        const int column = static_cast<int>(random.whole(-1, 63));
        const int row = static_cast<int>(random.whole(-1, 63));
        const bool centre = random.one_in(4);
        const double u = centre ? 0 : random.unit(), v = centre ? 0 : random.unit();
        Taps taps;
        tent(u, v, taps);
        const Blended out =
            blend(tile.image, tile.bytes.data(), column, row, taps, BlendAlpha::straight);
        for (std::uint32_t c = 0; c < channels; ++c) {
          const double expected = bilinear(tile, column, row, u, v, c);
          worst = std::max(worst, std::abs(out[c] - expected));
          if (!centre) continue;
          CHECK(out[c] == expected);
        }
        for (std::uint32_t c = channels; c < 4; ++c) CHECK(out[c] == 0);
      }
      CHECK(worst <
            (depth == Depth::u8 || depth == Depth::u16 ? 4e-6 : 3e-5));  // far below 1/255 and 1e-4
    }
  }
}

TEST_CASE("a float blend is right to the last bit or two, however far its samples are apart") {
  Random random(75);
  Tile tile;
  tile.image.channels = 1;
  tile.image.depth = Depth::float32;
  std::vector<float> samples(static_cast<std::size_t>(kEdge) * kEdge);
  for (int i = 0; i < 20000; ++i) {
    const std::size_t at =
        static_cast<std::size_t>((10 + store::kApron) * kEdge + 10 + store::kApron);
    const std::array<std::size_t, 4> places{at, at + 1, at + kEdge, at + kEdge + 1};
    for (const std::size_t place : places) {
      const auto exponent = static_cast<int>(random.whole(-160, 120));
      samples[place] = std::ldexp(random.between(-1.0F, 1.0F), exponent);
    }
    Taps taps;
    tent(random.unit(), random.unit(), taps);
    long double exact = 0, magnitude = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const long double term =
          static_cast<long double>(samples[places[k]]) * taps.weights[k] / taps.total;
      exact += term;
      magnitude += std::abs(term);
    }
    const double out = blend(tile.image, reinterpret_cast<const std::byte*>(samples.data()), 10, 10,
                             taps, BlendAlpha::straight)[0];
    if (std::abs(out - exact) > magnitude * 0x1p-50L) FAIL(out << " for " << exact);
    // The same four samples and weights in another order.
    std::swap(samples[places[0]], samples[places[3]]);
    std::swap(samples[places[1]], samples[places[2]]);
    std::swap(taps.weights[0], taps.weights[3]);
    std::swap(taps.weights[1], taps.weights[2]);
    CHECK(blend(tile.image, reinterpret_cast<const std::byte*>(samples.data()), 10, 10, taps,
                BlendAlpha::straight)[0] == out);
  }
}

TEST_CASE("colours times alpha are divided before they are blended, or left as they are") {
  Tile tile;
  tile.image.channels = 4;
  tile.image.depth = Depth::float32;
  tile.image.has_alpha = tile.image.premultiplied = true;
  std::vector<float> samples(static_cast<std::size_t>(kEdge) * kEdge * 4);
  float* const left =
      &samples[static_cast<std::size_t>((10 + store::kApron) * kEdge + 10 + store::kApron) * 4];
  for (const int i : {0, 4}) left[i + 3] = i == 0 ? 0.25F : 0.75F;
  for (const int i : {0, 4}) left[i] = i == 0 ? 0.125F : 0.375F;  // 0.5 each
  left[1] = 3;
  Taps taps;
  tent(0.5, 0, taps);
  const auto out = [&](BlendAlpha alpha) {
    return blend(tile.image, reinterpret_cast<const std::byte*>(samples.data()), 10, 10, taps,
                 alpha);
  };
  CHECK(out(BlendAlpha::straight) == Blended{0.5, 6, 0, 0.5});
  CHECK(out(BlendAlpha::stored) == Blended{0.25, 1.5, 0, 0.5});
  left[3] = 0;  // then a colour stays as it is
  CHECK(out(BlendAlpha::straight) == Blended{0.3125, 1.5, 0, 0.375});
}

TEST_CASE("places within 1/512 texel of a centre are that centre") {
  CHECK(settled(0.0019) == 0);
  CHECK(settled(0.002) == 0.002);
  CHECK(settled(0.998) == 0.998);
  CHECK(settled(0.9981) == 1);
}

TEST_CASE("blending 8-bit images to 8 bits is the blend, rounded to nearest") {
  Random random(73);
  for (std::uint32_t channels = 1; channels <= 4; ++channels) {
    const Tile tile = random_tile(random, Depth::u8, channels);
    for (int i = 0; i < 5000; ++i) {
      const int column = static_cast<int>(random.whole(-1, 63));
      const int row = static_cast<int>(random.whole(-1, 63));
      Taps taps;
      tent(random.one_in(4) ? 0 : random.unit(), random.one_in(4) ? 0.5 : random.unit(), taps);
      const Blended exact =
          blend(tile.image, tile.bytes.data(), column, row, taps, BlendAlpha::straight);
      std::array<std::byte, 5> out{};
      out[channels] = std::byte{0xAB};  // not to be touched
      blend_u8(tile.image, tile.bytes.data(), column, row, taps, out.data());
      for (std::uint32_t c = 0; c < channels; ++c) {
        const double value = exact[c] * 255;
        if (std::abs(std::to_integer<int>(out[c]) - value) > 0.5 + 1e-9)
          FAIL(std::to_integer<int>(out[c]) << " for " << value);
      }
      CHECK(out[channels] == std::byte{0xAB});
    }
  }
}

TEST_CASE("8-bit blends clamp what a kernel with negative weights overshoots") {
  Tile tile;
  tile.image.channels = 1;
  tile.bytes.assign(static_cast<std::size_t>(kEdge) * kEdge, std::byte{0});
  const auto at = [](int column, int row) {
    return static_cast<std::size_t>((row + store::kApron) * kEdge + column + store::kApron);
  };
  tile.bytes[at(10, 10)] = std::byte{255};
  Taps taps;
  taps.first = -1;
  taps.size = 4;
  taps.weights[5] = (1 << 20) + 2000;  // the hit's own texel
  taps.weights[0] = -2000;
  taps.total = 1 << 20;
  std::byte out{};
  blend_u8(tile.image, tile.bytes.data(), 10, 10, taps, &out);
  CHECK(out == std::byte{255});
  blend_u8(tile.image, tile.bytes.data(), 11, 11, taps, &out);  // only the negative tap sees it
  CHECK(out == std::byte{0});
}

TEST_CASE("a placed coordinate blends what the unbounded image has there") {
  Random random(74);
  for (const std::uint32_t size : {1U, 2U, 3U, 64U, 100U}) {
    std::vector<double> texels(size);
    for (double& t : texels) t = random.unit();
    for (const Wrap wrap : {Wrap::repeat, Wrap::mirror, Wrap::clamp}) {
      const auto texel = [&](std::int64_t i) {
        return texels[static_cast<std::size_t>(store::wrapped(i, size, wrap))];
      };
      for (int i = 0; i < 3000; ++i) {
        const auto base = static_cast<std::int32_t>(random.whole(-400, 400));
        float frac = random.between(-3.0F, 3.0F);
        if (random.one_in(4)) frac = std::round(frac);
        const double x = base + double{frac};
        const double below = std::floor(x), rest = x - below;
        const auto whole = static_cast<std::int64_t>(below);
        const double expected = (1 - rest) * texel(whole) + rest * texel(whole + 1);
        const Coordinate at = placed(base, frac, size, wrap);
        CAPTURE(size, static_cast<int>(wrap), base, frac);
        if (at.texel < -1 || at.texel >= static_cast<std::int64_t>(size) || at.rest < 0 ||
            at.rest >= 1) {
          FAIL("outside: " << at.texel << " + " << at.rest);
        }
        const double got = (1 - at.rest) * texel(at.texel) + at.rest * texel(at.texel + 1);
        if (std::abs(got - expected) > 1e-9) FAIL(got << " for " << expected);
      }
    }
  }
  CHECK(placed(-1, 0.5F, 8, Wrap::clamp).texel == -1);
  CHECK(placed(-1000000000, 0.5F, 8, Wrap::repeat).rest == 0.5);
  CHECK(placed(7, 0, 8, Wrap::repeat).texel == 7);
  CHECK(placed(8, 0, 8, Wrap::repeat).texel == 0);
  CHECK(placed(8, 0.25F, 8, Wrap::mirror).texel == 6);
  CHECK(placed(8, 0.25F, 8, Wrap::mirror).rest == 0.75);
}

TEST_CASE("a coordinate over UDIM tiles belongs to the tile that holds it") {
  // Tiles of 8 texels: the border between the first two lies at texel 7.5.
  CHECK(in_tile(7, 0.25F, 8).period == 0);
  CHECK(in_tile(7, 0.25F, 8).texel == 7.25);
  CHECK(in_tile(7, 0.5F, 8).period == 1);
  CHECK(in_tile(7, 0.5F, 8).texel == -0.5);
  CHECK(in_tile(6, 1.5F, 8).period == 1);
  CHECK(in_tile(0, -0.5F, 8).period == 0);
  CHECK(in_tile(0, -0.75F, 8).period == -1);
  CHECK(in_tile(0, -0.75F, 8).texel == 7.25);
  CHECK(in_tile(-16, 0, 8).period == -2);
  // The middle of a tile is the middle of its image, whatever its size; its border is the border.
  CHECK(scaled(3.5, 8, 8).texel == 3);
  CHECK(scaled(3.5, 8, 8).rest == 0.5);
  CHECK(scaled(3.5, 8, 100).texel == 49);
  CHECK(scaled(3.5, 8, 100).rest == 0.5);
  CHECK(scaled(-0.5, 8, 100).texel == -1);
  CHECK(scaled(-0.5, 8, 100).rest == 0.5);
  CHECK(scaled(7.4999, 8, 1).texel == 0);
  CHECK(scaled(7.4999, 8, 100).texel == 99);
}
