// SPDX-License-Identifier: Apache-2.0
#include "projection/blend.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "core/portable_math.h"
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
  CHECK_FALSE(taps.wide);
  CHECK((taps.square == std::array<std::int32_t, 4>{1 << 20, 0, 0, 0} && taps.total == 1 << 20));
  tent(0.25, 0.5, taps);  // 3/8, 1/8, 3/8, 1/8
  CHECK(taps.square == std::array<std::int32_t, 4>{393216, 131072, 393216, 131072});
  Random random(71);
  for (int i = 0; i < 10000; ++i) {
    tent(random.unit(), random.unit(), taps);
    CHECK(std::abs(taps.total - (1 << 20)) <= 2);
    CHECK(taps.total == std::accumulate(taps.square.begin(), taps.square.end(), 0));
  }
}

TEST_CASE("the cubics' weights are Keys', in steps of 2^-20, 2^20 together") {
  using Weights = std::array<std::int32_t, 4>;
  Taps taps;
  for (const BlendKernel kernel : {cubic, sharp}) {
    kernel(0, 1, taps);  // on a texel's centre it has all the weight
    CHECK(taps.wide);
    CHECK((taps.across == Weights{0, 1 << 20, 0, 0} && taps.down == Weights{0, 0, 1 << 20, 0}));
  }
  cubic(0.5, 0.25, taps);
  CHECK(taps.across == Weights{-65536, 589824, 589824, -65536});  // -1/16, 9/16, 9/16, -1/16
  CHECK(taps.down == Weights{-73728, 909312, 237568, -24576});    // (-9, 111, 29, -3) / 128
  sharp(0.5, 0.75, taps);
  CHECK(taps.across == Weights{-98304, 622592, 622592, -98304});  // -3/32, 19/32, 19/32, -3/32
  CHECK(taps.down == Weights{-36864, 274432, 921600, -110592});   // (-9, 67, 225, -27) / 256
  Random random(76);
  for (int i = 0; i < 10000; ++i) {
    (random.one_in(2) ? cubic : sharp)(random.unit(), random.unit(), taps);
    for (const Weights& w : {taps.across, taps.down})
      CHECK(std::accumulate(w.begin(), w.end(), 0) == 1 << 20);
  }
}

namespace {

/// Four samples and weights, kept between the two in the middle.
double kept(const std::array<std::int32_t, 4>& weights, const std::array<double, 4>& samples) {
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += weights[i] * samples[i] / (1 << 20);
  return std::clamp(sum, std::min(samples[1], samples[2]), std::max(samples[1], samples[2]));
}

}  // namespace

TEST_CASE("a cubic blend goes along rows and then down, each sum kept between its inner two") {
  Random random(77);
  for (const Depth depth : {Depth::u8, Depth::u16, Depth::half, Depth::float32}) {
    for (std::uint32_t channels = 1; channels <= 4; ++channels) {
      const Tile tile = random_tile(random, depth, channels);
      for (int i = 0; i < 3000; ++i) {
        const int column = static_cast<int>(random.whole(-1, 63));
        const int row = static_cast<int>(random.whole(-1, 63));
        Taps taps;
        sharp(random.unit(), random.one_in(4) ? 0 : random.unit(), taps);
        const Blended out =
            blend(tile.image, tile.bytes.data(), column, row, taps, BlendAlpha::straight);
        for (std::uint32_t c = 0; c < channels; ++c) {
          std::array<double, 4> rows{};
          for (int y = 0; y < 4; ++y) {
            std::array<double, 4> samples{};
            for (int x = 0; x < 4; ++x)
              samples[static_cast<std::size_t>(x)] = tile.at(column - 1 + x, row - 1 + y, c);
            rows[static_cast<std::size_t>(y)] = kept(taps.across, samples);
          }
          const double expected = kept(taps.down, rows);
          if (std::abs(out[c] - expected) > 1e-12) FAIL(out[c] << " for " << expected);
        }
      }
    }
  }
}

TEST_CASE("a cubic blend does not jump where it goes on to the next four texels") {
  Random random(80);
  const Tile tile = random_tile(random, Depth::float32, 1);
  const auto at = [&](int column, int row, double u, double v) {
    Taps taps;
    sharp(u, v, taps);
    return blend(tile.image, tile.bytes.data(), column, row, taps, BlendAlpha::straight)[0];
  };
  constexpr double kNear = 1e-5;  // samples are -4..4: a slope of 40 at most
  for (int i = 0; i < 3000; ++i) {
    const int column = static_cast<int>(random.whole(0, 62));
    const int row = static_cast<int>(random.whole(0, 62));
    const double w = random.unit();
    CHECK(std::abs(at(column, row, 1 - kNear, w) - at(column + 1, row, kNear, w)) < 1e-3);
    CHECK(std::abs(at(column, row, w, 1 - kNear) - at(column, row + 1, w, kNear)) < 1e-3);
  }
}

TEST_CASE("what lies beyond the four texels around a hit neither rings nor tints") {
  Tile tile;
  tile.image.channels = 4;
  tile.image.has_alpha = true;
  const std::array<std::byte, 4> ink{std::byte{50}, std::byte{90}, std::byte{200}, std::byte{255}};
  // Columns up to 10 have the ink, the others another colour without alpha.
  for (int i = 0; i < kEdge * kEdge; ++i) {
    for (const std::byte sample : ink)
      tile.bytes.push_back(i % kEdge - store::kApron <= 10 ? sample : std::byte{0});
  }
  for (const BlendKernel kernel : {cubic, sharp}) {
    for (double u = 0; u < 1; u += 0.0625) {
      Taps taps;
      kernel(u, 0.3, taps);
      std::array<std::byte, 4> out{};
      blend_u8(tile.image, tile.bytes.data(), 9, 20, taps, out.data());  // columns 8 to 11
      CHECK(out == ink);
      blend_u8(tile.image, tile.bytes.data(), 11, 20, taps, out.data());
      CHECK(out == std::array<std::byte, 4>{});
      blend_u8(tile.image, tile.bytes.data(), 10, 20, taps, out.data());
      for (std::size_t c = 0; c < 4; ++c) CHECK(out[c] <= ink[c]);
    }
    Taps taps;
    kernel(0, 0.5, taps);  // in the column itself: what is beside it has no weight
    std::array<std::byte, 4> out{};
    blend_u8(tile.image, tile.bytes.data(), 10, 20, taps, out.data());
    CHECK(out == ink);
  }
}

TEST_CASE("a straight gradient stays straight under the cubic kernel") {
  Tile tile;
  tile.image.channels = 1;
  tile.image.depth = Depth::float32;
  std::vector<float> samples;
  for (int i = 0; i < kEdge * kEdge; ++i)
    samples.push_back(static_cast<float>(3 * (i % kEdge) - 5 * (i / kEdge)));
  Random random(78);
  for (int i = 0; i < 1000; ++i) {
    const double u = random.unit(), v = random.unit();
    Taps taps;
    cubic(u, v, taps);
    const double out = blend(tile.image, reinterpret_cast<const std::byte*>(samples.data()), 10, 10,
                             taps, BlendAlpha::straight)[0];
    if (std::abs(out - (3 * (12 + u) - 5 * (12 + v))) > 1e-4) FAIL(out);
  }
}

TEST_CASE("a cubic blend of floats stays finite and where its samples are") {
  Tile tile;
  tile.image.channels = 1;
  tile.image.depth = Depth::float32;
  constexpr float kLargest = std::numeric_limits<float>::max();
  Random random(79);
  for (int i = 0; i < 2000; ++i) {
    std::vector<float> samples(static_cast<std::size_t>(kEdge) * kEdge);
    for (int y = 11; y < 15; ++y) {
      for (int x = 11; x < 15; ++x)
        samples[static_cast<std::size_t>(y * kEdge + x)] = random.one_in(2) ? kLargest : -kLargest;
    }
    Taps taps;
    sharp(random.unit(), random.unit(), taps);
    const double out = blend(tile.image, reinterpret_cast<const std::byte*>(samples.data()), 10, 10,
                             taps, BlendAlpha::straight)[0];
    if (!(std::abs(out) <= kLargest)) FAIL(out);
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
          static_cast<long double>(samples[places[k]]) * taps.square[k] / taps.total;
      exact += term;
      magnitude += std::abs(term);
    }
    const double out = blend(tile.image, reinterpret_cast<const std::byte*>(samples.data()), 10, 10,
                             taps, BlendAlpha::straight)[0];
    if (std::abs(out - exact) > magnitude * 0x1p-50L) FAIL(out << " for " << exact);
    // The same four samples and weights in another order.
    std::swap(samples[places[0]], samples[places[3]]);
    std::swap(samples[places[1]], samples[places[2]]);
    std::swap(taps.square[0], taps.square[3]);
    std::swap(taps.square[1], taps.square[2]);
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

TEST_CASE("a cubic blend divides each colour by its own alpha first") {
  Tile tile;
  tile.image.channels = 4;
  tile.image.depth = Depth::float32;
  tile.image.has_alpha = tile.image.premultiplied = true;
  std::vector<float> samples(static_cast<std::size_t>(kEdge) * kEdge * 4);
  // Texels 9 to 12 of row 10: colours 0.25, 0.25, 0.75, 1.25, alpha 0.5, 0.25, 0.75, 0.
  float* const at =
      &samples[static_cast<std::size_t>((10 + store::kApron) * kEdge + 9 + store::kApron) * 4];
  const std::array<float, 4> stored = {0.125F, 0.0625F, 0.5625F, 1.25F};
  const std::array<float, 4> alphas = {0.5F, 0.25F, 0.75F, 0};
  for (std::size_t i = 0; i < 4; ++i) {
    at[4 * i] = stored[i];
    at[4 * i + 3] = alphas[i];
  }
  Taps taps;
  cubic(0.5, 0, taps);  // -1/16, 9/16, 9/16, -1/16
  const auto out = [&](BlendAlpha alpha) {
    return blend(tile.image, reinterpret_cast<const std::byte*>(samples.data()), 10, 10, taps,
                 alpha);
  };
  // (9 (0.25 + 0.75) - 0.25 - 1.25) / 16; alpha (9 (0.25 + 0.75) - 0.5) / 16
  CHECK(out(BlendAlpha::straight) == Blended{0.46875, 0, 0, 0.53125});
  // (9 (0.0625 + 0.5625) - 0.125 - 1.25) / 16
  CHECK(out(BlendAlpha::stored) == Blended{0.265625, 0, 0, 0.53125});
  at[12] = 0.5F;  // then the colours are 0.25, 1, 1, 0.5: their sum of 1.08 is kept at 1
  at[8] = 0.75F;
  at[4] = 0.25F;
  CHECK(out(BlendAlpha::straight)[0] == 1);
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
      (random.one_in(2) ? tent : cubic)(random.one_in(4) ? 0 : random.unit(),
                                        random.one_in(4) ? 0.5 : random.unit(), taps);
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
