// SPDX-License-Identifier: Apache-2.0
#include "shading/paint_over.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "core/portable_math.h"

using namespace pounce;
using shading::PaintAlpha;
using shading::TexelFormat;

namespace {

using Bytes = std::vector<std::byte>;

Bytes bytes(const std::vector<int>& values) {
  Bytes out;
  for (const int v : values) out.push_back(static_cast<std::byte>(v));
  return out;
}

template <class T>
Bytes bytes_of(const std::vector<T>& values) {
  Bytes out(values.size() * sizeof(T));
  std::memcpy(out.data(), values.data(), out.size());
  return out;
}

template <class T>
std::vector<T> values_of(const Bytes& in) {
  std::vector<T> out(in.size() / sizeof(T));
  std::memcpy(out.data(), in.data(), in.size());
  return out;
}

Bytes noise(std::size_t count, std::uint32_t state) {
  Bytes out;
  while (out.size() < count)
    out.push_back(static_cast<std::byte>((state = state * 1664525U + 1013904223U) >> 24));
  return out;
}

Bytes painted(const TexelFormat& format, PaintAlpha alpha, const std::vector<float>& weights,
              Bytes old, const Bytes& fresh) {
  REQUIRE(old.size() == weights.size() * format.texel_bytes());
  shading::paint_over(format, alpha, weights.data(), fresh.data(), weights.size(), old.data());
  return old;
}

const TexelFormat kRgb8{3, Depth::u8, false, true, false};
const TexelFormat kRgba8{4, Depth::u8, false, true, true};

}  // namespace

TEST_CASE("where the mask is 0 old samples keep their bits, where it is 1 new ones do",
          "[texture]") {
  const Depth depth = GENERATE(Depth::u8, Depth::u16, Depth::half, Depth::float32);
  const std::uint32_t channels = GENERATE(1U, 2U, 3U, 4U);
  const bool alpha = channels % 2 == 0;
  const TexelFormat format{channels, depth, depth >= Depth::half, true, alpha};
  // Every byte pattern, NaN and infinity of the float formats among them.
  constexpr std::size_t kTexels = 4096;
  const Bytes old = noise(kTexels * format.texel_bytes(), 1);
  const Bytes fresh = noise(old.size(), 2);
  std::vector<float> weights(kTexels);
  for (std::size_t i = 0; i < kTexels; ++i) weights[i] = i % 2 == 0 ? 0.0F : 1.0F;
  for (const PaintAlpha mode : {PaintAlpha::mix, PaintAlpha::premultiplied}) {
    const Bytes out = painted(format, mode, weights, old, fresh);
    const std::size_t size = format.texel_bytes();
    bool exact = true;
    for (std::size_t i = 0; i < kTexels; ++i) {
      const Bytes& from = i % 2 == 0 ? old : fresh;
      exact = exact && std::memcmp(out.data() + i * size, from.data() + i * size, size) == 0;
    }
    CHECK(exact);
  }
}

TEST_CASE("in between, the stored numbers mix and round to nearest", "[texture]") {
  // 200 + (100 - 200) / 4 = 175; 10 + 1 / 2 rounds up; 0 + 255 * 0.1 = 25.5 is 25.50000038.
  CHECK(painted(kRgb8, PaintAlpha::keep, {.25F, .5F, .1F},
                bytes({200, 0, 7, 10, 10, 10, 0, 0, 255}),
                bytes({100, 255, 7, 11, 12, 9, 255, 0, 0})) ==
        bytes({175, 64, 7, 11, 11, 10, 26, 0, 229}));
  const TexelFormat deep{1, Depth::u16, false, true, false};
  CHECK(values_of<std::uint16_t>(
            painted(deep, PaintAlpha::keep, {.5F}, bytes_of<std::uint16_t>({1000}),
                    bytes_of<std::uint16_t>({2001}))) == std::vector<std::uint16_t>{1501});
  const TexelFormat real{1, Depth::float32, true, true, false};
  CHECK(values_of<float>(painted(real, PaintAlpha::keep, {.75F}, bytes_of<float>({-4}),
                                 bytes_of<float>({1000}))) == std::vector<float>{749});
  const TexelFormat halves{1, Depth::half, true, true, false};
  CHECK(values_of<std::uint16_t>(painted(halves, PaintAlpha::keep, {.5F},
                                         bytes_of<std::uint16_t>({float_to_half(1)}),
                                         bytes_of<std::uint16_t>({float_to_half(2)}))) ==
        std::vector<std::uint16_t>{float_to_half(1.5F)});
}

TEST_CASE("infinite samples mix to what is infinite, never to what is no number", "[texture]") {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const TexelFormat real{1, Depth::float32, true, true, false};
  const auto mix = [&](float old, float fresh, float weight) {
    return values_of<float>(painted(real, PaintAlpha::keep, {weight}, bytes_of<float>({old}),
                                    bytes_of<float>({fresh})))[0];
  };
  CHECK(mix(kInfinity, 2, 0.5F) == kInfinity);
  CHECK(mix(kInfinity, 2, 0) == kInfinity);
  CHECK(mix(kInfinity, 2, 1) == 2);
  CHECK(mix(2, -kInfinity, 0.5F) == -kInfinity);
  CHECK(mix(2, -kInfinity, 0) == 2);
  CHECK(mix(-kInfinity, kInfinity, 0.5F) == -kInfinity);
}

TEST_CASE("equal samples stay equal under any mask", "[texture]") {
  Bytes all;
  std::vector<float> weights;
  for (int w = 0; w <= 255; ++w) {
    for (int v = 0; v <= 255; ++v) {
      all.push_back(static_cast<std::byte>(v));
      weights.push_back(static_cast<float>(w) / 255);
    }
  }
  CHECK(painted({1, Depth::u8, false, true, false}, PaintAlpha::keep, weights, all, all) == all);
}

TEST_CASE("the old alpha stays when the source has none", "[texture]") {
  CHECK(painted(kRgba8, PaintAlpha::keep, {0, 1, .5F},
                bytes({1, 2, 3, 4, 10, 20, 30, 40, 100, 100, 100, 77}),
                bytes({9, 9, 9, 255, 50, 60, 70, 255, 200, 200, 200, 255})) ==
        bytes({1, 2, 3, 4, 50, 60, 70, 40, 150, 150, 150, 77}));
}

TEST_CASE("a transparent side does not colour the rim", "[texture]") {
  // New: transparent black. The colour stays, alpha halves.
  CHECK(painted(kRgba8, PaintAlpha::mix, {.5F}, bytes({200, 100, 50, 255}), bytes({0, 0, 0, 0})) ==
        bytes({200, 100, 50, 128}));
  // Old: transparent. The new colour comes whole.
  CHECK(painted(kRgba8, PaintAlpha::mix, {.5F}, bytes({0, 0, 0, 0}), bytes({200, 100, 50, 255})) ==
        bytes({200, 100, 50, 128}));
  // Both half as opaque: as without alpha.
  CHECK(painted(kRgba8, PaintAlpha::mix, {.5F}, bytes({200, 0, 0, 100}), bytes({100, 0, 0, 100})) ==
        bytes({150, 0, 0, 100}));
  // Both transparent: colours mix as they are.
  CHECK(painted(kRgba8, PaintAlpha::mix, {.5F}, bytes({200, 0, 0, 0}), bytes({100, 0, 0, 0})) ==
        bytes({150, 0, 0, 0}));
}

TEST_CASE("a mask is brightness times alpha", "[texture]") {
  const auto weights = [](const TexelFormat& format, const Bytes& in) {
    std::vector<float> out(in.size() / format.texel_bytes());
    shading::mask_weights(format, in.data(), out.size(), out.data());
    return out;
  };
  using Weights = std::vector<float>;
  CHECK(weights({1, Depth::u8, false, true, false}, bytes({0, 255, 51})) == Weights{0, 1, .2F});
  CHECK(weights({2, Depth::u8, false, true, true}, bytes({255, 51, 255, 255, 0, 255})) ==
        Weights{.2F, 1, 0});
  CHECK(weights(kRgb8, bytes({255, 255, 255, 51, 51, 51, 0, 255, 0})) == Weights{1, .2F, .7152F});
  CHECK(weights(kRgba8, bytes({255, 255, 255, 51, 255, 255, 255, 255})) == Weights{.2F, 1});
  CHECK(weights({1, Depth::u16, false, true, false}, bytes_of<std::uint16_t>({65535, 0})) ==
        Weights{1, 0});
  const float nan = std::numeric_limits<float>::quiet_NaN();
  CHECK(weights({1, Depth::float32, true, true, false}, bytes_of<float>({-1, .5F, 7, nan})) ==
        Weights{0, .5F, 1, 0});
}

TEST_CASE("a picture in another format keeps what it shows", "[texture]") {
  const auto converted = [](const TexelFormat& from, const Bytes& in, const TexelFormat& to) {
    Bytes out(in.size() / from.texel_bytes() * to.texel_bytes());
    shading::convert_texels(from, in.data(), to, in.size() / from.texel_bytes(), out.data());
    return out;
  };
  CHECK(converted({1, Depth::u8, false, true, false}, bytes({0, 77, 255}), kRgb8) ==
        bytes({0, 0, 0, 77, 77, 77, 255, 255, 255}));
  CHECK(converted(kRgb8, bytes({1, 2, 3}), kRgba8) == bytes({1, 2, 3, 255}));
  Bytes every;
  for (int v = 0; v < 256; ++v) every.push_back(static_cast<std::byte>(v));
  const TexelFormat gray8{1, Depth::u8, false, true, false},
      linear{1, Depth::float32, true, true, false};
  CHECK(converted(linear, converted(gray8, every, linear), gray8) == every);
  // Data is never converted between sRGB coding and linear.
  const TexelFormat data8{1, Depth::u8, false, false, false},
      data{1, Depth::float32, true, false, false};
  CHECK(values_of<float>(converted(data8, bytes({51}), data)) == std::vector<float>{.2F});
}

TEST_CASE("alpha alone is copied", "[texture]") {
  Bytes to = bytes({1, 2, 3, 4, 5, 6, 7, 8});
  shading::copy_alpha(kRgba8, bytes({0, 0, 0, 40, 0, 0, 0, 80}).data(), 2, to.data());
  CHECK(to == bytes({1, 2, 3, 40, 5, 6, 7, 80}));
}
