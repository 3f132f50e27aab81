// SPDX-License-Identifier: Apache-2.0
//
// What a finer target does to a cubic's weights and sums.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>

#include "projection/blend.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::projection;
using pounce::test::Random;

namespace {

constexpr int kEdge = store::kColourTileEdge;
constexpr std::int32_t kMost = 43690;  // 1/24 in steps of 2^-20
using Four = std::array<double, 4>;
using Weights = std::array<std::int32_t, 4>;

/// A tile of one float channel.
struct FloatTile {
  store::ColourDirectory image;
  std::vector<float> samples = std::vector<float>(static_cast<std::size_t>(kEdge) * kEdge);

  FloatTile() {
    image.channels = 1;
    image.depth = Depth::float32;
  }
  float& at(int column, int row) {
    return samples[static_cast<std::size_t>((row + store::kApron) * kEdge + column +
                                            store::kApron)];
  }
  double blend(int column, int row, const Taps& taps) const {
    return projection::blend(image, reinterpret_cast<const std::byte*>(samples.data()), column, row,
                             taps, BlendAlpha::straight)[0];
  }
};

/// The blend of four values, laid along a row or down a column, under a cubic for a finer target.
double sharpened(const Four& values, double place, std::int32_t by, bool down = false) {
  FloatTile tile;
  for (int y = -1; y < 3; ++y) {
    for (int x = -1; x < 3; ++x)
      tile.at(10 + x, 10 + y) =
          static_cast<float>(values[static_cast<std::size_t>(down ? y + 1 : x + 1)]);
  }
  Taps taps;
  cubic(down ? 0 : place, down ? place : 0, taps);
  sharpen(down ? Sharpening{0, by} : Sharpening{by, 0}, down ? 0 : place, down ? place : 0, taps);
  return tile.blend(10, 10, taps);
}

/// The same sum once more, in doubles and in words of its own, of values in 0..1.
double expected(const Weights& weights, const std::array<std::int32_t, 2>& moves, const Four& p) {
  const double first_share = moves[0] / 0x1p20, second_share = moves[1] / 0x1p20;
  const auto move = [](double before, double own, double after) {
    const double lesser = std::min(std::abs(own - before), std::abs(after - own));
    const double most = std::min({12 * lesser, 24 * own, 24 * (1 - own)});
    return std::clamp(2 * own - before - after, -most, most);
  };
  const double left = move(p[0], p[1], p[2]), right = move(p[1], p[2], p[3]);
  const double all = first_share + second_share;
  const double first = p[1] + all * left, second = p[2] + all * right;
  double sum = first_share * left + second_share * right;
  for (std::size_t i = 0; i < 4; ++i) sum += weights[i] * p[i] / 0x1p20;
  return std::clamp(sum, std::min(first, second), std::max(first, second));
}

}  // namespace

TEST_CASE("a finer target's weights, worked by hand") {
  Taps taps;
  cubic(0.5, 0.25, taps);
  sharpen({32768, 16384}, 0.5, 0.25, taps);  // 1/32, 1/64
  CHECK(taps.sharpened);
  // Halfway nothing is steeper: Catmull-Rom's -1/16, 9/16, 9/16, -1/16.
  CHECK(taps.across == Weights{-65536, 589824, 589824, -65536});
  CHECK(taps.move_across == std::array<std::int32_t, 2>{16384, 16384});
  // (-9, 111, 29, -3) / 128 and 3/64 * 1/4 * 3/4 * 1/2 = 4608 / 2^20 times (-1, 3, -3, 1).
  CHECK(taps.down == Weights{-73728 - 4608, 909312 + 13824, 237568 - 13824, -24576 + 4608});
  CHECK(taps.move_down == std::array<std::int32_t, 2>{12288, 4096});
  Random random(81);
  for (int i = 0; i < 10000; ++i) {
    const double u = random.unit(), v = random.unit();
    const Sharpening by{static_cast<std::int32_t>(random.whole(0, kMost)),
                        static_cast<std::int32_t>(random.whole(1, kMost))};
    (random.one_in(2) ? cubic : sharp)(u, v, taps);
    sharpen(by, u, v, taps);
    for (const Weights& w : {taps.across, taps.down}) {
      CHECK(std::accumulate(w.begin(), w.end(), 0) == 1 << 20);
    }
    CHECK(taps.move_across[0] + taps.move_across[1] == by.across);
    CHECK(taps.move_down[0] + taps.move_down[1] == by.down);
  }
}

TEST_CASE("targets that are not finer, and the tent, keep their weights") {
  Taps plain, taps;
  for (const BlendKernel kernel : {tent, cubic, sharp}) {
    kernel(0.3, 0.6, plain);
    kernel(0.3, 0.6, taps);
    sharpen({0, 0}, 0.3, 0.6, taps);
    CHECK_FALSE(taps.sharpened);
    CHECK((taps.across == plain.across && taps.down == plain.down && taps.square == plain.square));
  }
  tent(0.3, 0.6, taps);
  sharpen({kMost, kMost}, 0.3, 0.6, taps);
  CHECK_FALSE(taps.sharpened);
  // A kernel that is asked again forgets what was asked of it before.
  cubic(0.3, 0.6, taps);
  sharpen({kMost, 0}, 0.3, 0.6, taps);
  CHECK(taps.sharpened);
  cubic(0.3, 0.6, taps);
  CHECK_FALSE(taps.sharpened);
}

TEST_CASE("a peak is higher in its middle than its texel's mean, worked by hand") {
  constexpr std::int32_t kShare = 32768;  // 1/32
  for (const bool down : {false, true}) {
    // Steps of 1/2 up and 1/4 down: 3/4 of 1/32 is added.
    CHECK(sharpened({0.25, 0.75, 0.5, 0.5}, 0, kShare, down) == 0.7734375);
    CHECK(sharpened({0.75, 0.25, 0.5, 0.5}, 0, kShare, down) == 0.2265625);
    // Beside what is flat nothing is: an edge does not ring.
    CHECK(sharpened({0.25, 0.75, 0.75, 0.25}, 0, kShare, down) == 0.75);
    CHECK(sharpened({0.25, 0.25, 0.75, 0.5}, 0, kShare, down) == 0.25);
    // A step of 1/64 beside one of 1/2: 12/64 of 1/32, not 31/64.
    CHECK(sharpened({0.25, 0.75, 0.765625, 0.5}, 0, kShare, down) == 0.755859375);
    // Halfway: (9 (1/2 + 3/4) - 1/4) / 16 and half of each one's move, 1/4 and 3/4 of 1/32.
    CHECK(sharpened({0, 0.5, 0.75, 0.25}, 0.5, kShare, down) == 0.703125);
  }
}

TEST_CASE("what was in 0..1 stays there, and no sign changes") {
  CHECK(sharpened({0, 1, 0, 0}, 0, kMost) == 1);
  CHECK(sharpened({1, 0, 1, 1}, 0, kMost) == 0);
  CHECK(sharpened({0, 2, 0, 0}, 0, 32768) == 2.125);
  CHECK(sharpened({0, 1.03125, 0, 0}, 0, 32768) == 1.0546875);  // 1/32 above 1: 24/32 of that
  CHECK(sharpened({0, -2, 0, 0}, 0, 32768) == -2.125);
  for (const double sign : {1.0, -1.0}) {  // to 0 but for the last step of 1/24, not beyond
    const double out = sign * sharpened({sign * 8, sign * 0.125, sign * 8, 0}, 0, kMost);
    CHECK((out >= 0 && out < 1e-5));
  }
  constexpr float kLargest = std::numeric_limits<float>::max();
  CHECK(sharpened({-kLargest, kLargest, -kLargest, 0}, 0, kMost) == static_cast<double>(kLargest));
}

TEST_CASE("what is straight stays straight, and a parabola gets back what its means have lost") {
  Random random(82);
  for (int i = 0; i < 2000; ++i) {
    const double t = random.unit();
    const double straight = sharpened({-4, -1, 2, 5}, t, kMost);
    if (std::abs(straight - (-1 + 3 * t)) > 1e-5) FAIL(straight);
    // Means of x^2 over texels around 3, 4, 5, 6: a twelfth above the middle's own.
    const double parabola =
        sharpened({9 + 1.0 / 12, 16 + 1.0 / 12, 25 + 1.0 / 12, 36 + 1.0 / 12}, t, kMost);
    if (std::abs(parabola - (4 + t) * (4 + t)) > 1e-4) FAIL(parabola << " at " << t);
  }
}

TEST_CASE("a sharpened blend is that of its formula, in integers of 8 and 16 bits and in floats") {
  Random random(83);
  for (const Depth depth : {Depth::u8, Depth::u16, Depth::float32}) {
    const double one = depth == Depth::u8 ? 255 : depth == Depth::u16 ? 65535 : 1;
    store::ColourDirectory image;
    image.channels = 1;
    image.depth = depth;
    std::vector<std::byte> bytes;
    std::vector<double> samples;
    for (int i = 0; i < kEdge * kEdge; ++i) {
      const auto put = [&](auto value) {
        const auto* first = reinterpret_cast<const std::byte*>(&value);
        bytes.insert(bytes.end(), first, first + sizeof value);
        samples.push_back(value / one);
      };
      const bool extreme = random.one_in(3);  // so that bounds are met
      const double sample = extreme ? (random.one_in(2) ? 1 : 0) : random.unit();
      if (depth == Depth::u8)
        put(static_cast<std::uint8_t>(sample * one));
      else if (depth == Depth::u16)
        put(static_cast<std::uint16_t>(sample * one));
      else
        put(static_cast<float>(sample));
    }
    for (int i = 0; i < 5000; ++i) {
      const int column = static_cast<int>(random.whole(-1, 63));
      const int row = static_cast<int>(random.whole(-1, 63));
      const double u = random.unit(), v = random.one_in(4) ? 0 : random.unit();
      Taps taps;
      (random.one_in(2) ? cubic : sharp)(u, v, taps);
      sharpen({static_cast<std::int32_t>(random.whole(0, kMost)),
               static_cast<std::int32_t>(random.whole(1, kMost))},
              u, v, taps);
      Four rows{};
      for (int y = 0; y < 4; ++y) {
        Four values{};
        for (int x = 0; x < 4; ++x)
          values[static_cast<std::size_t>(x)] = samples[static_cast<std::size_t>(
              (row - 1 + y + store::kApron) * kEdge + column - 1 + x + store::kApron)];
        rows[static_cast<std::size_t>(y)] = expected(taps.across, taps.move_across, values);
      }
      const double right = expected(taps.down, taps.move_down, rows);
      const double out = blend(image, bytes.data(), column, row, taps, BlendAlpha::straight)[0];
      if (std::abs(out - right) > 1e-12) FAIL(out << " for " << right);
      if (depth != Depth::u8) continue;
      std::byte rounded{};
      blend_u8(image, bytes.data(), column, row, taps, &rounded);
      if (std::abs(std::to_integer<int>(rounded) - right * 255) > 0.5 + 1e-9)
        FAIL(std::to_integer<int>(rounded) << " for " << right * 255);
    }
  }
}

TEST_CASE("a sharpened blend does not jump where it goes on to the next four texels") {
  Random random(84);
  FloatTile tile;
  for (float& sample : tile.samples) sample = random.between(-4.0F, 4.0F);
  const auto at = [&](int column, int row, double u, double v) {
    Taps taps;
    cubic(u, v, taps);
    sharpen({kMost, kMost}, u, v, taps);
    return tile.blend(column, row, taps);
  };
  constexpr double kNear = 1e-5;  // samples are -4..4: a slope of 60 at most
  for (int i = 0; i < 3000; ++i) {
    const int column = static_cast<int>(random.whole(0, 62));
    const int row = static_cast<int>(random.whole(0, 62));
    const double w = random.unit();
    CHECK(std::abs(at(column, row, 1 - kNear, w) - at(column + 1, row, kNear, w)) < 1.5e-3);
    CHECK(std::abs(at(column, row, w, 1 - kNear) - at(column, row + 1, w, kNear)) < 1.5e-3);
  }
}

TEST_CASE("paint beyond the two beside a hit moves a finer target by half of what they differ") {
  Random random(85);
  for (int i = 0; i < 20000; ++i) {
    Four p{};
    for (double& sample : p) sample = random.between(0.0F, 64.0F);
    if (random.one_in(4)) p[2] = p[1];  // within a chart: not at all
    const double out = sharpened(p, random.unit(), kMost, random.one_in(2));
    const double low = std::min(p[1], p[2]), high = std::max(p[1], p[2]);
    const double half = (high - low) / 2 + 1e-5;
    if (out < low - half || out > high + half) FAIL(out << " beside " << p[1] << ", " << p[2]);
    std::sort(p.begin(), p.end());  // and what rises goes on rising
    const double own = sharpened(p, 0, kMost);
    if (own < (p[0] + p[1]) / 2 - 1e-5 || own > (p[1] + p[2]) / 2 + 1e-5)
      FAIL(own << " from " << p[1] << " between " << p[0] << " and " << p[2]);
  }
}
