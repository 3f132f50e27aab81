// SPDX-License-Identifier: Apache-2.0
#include "projection/blend.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/half.h"

namespace pounce::projection {
namespace {

constexpr double kWeightSteps = 1 << 20;

/// A sample of an integer image as it is counted: 0..255 or 0..65535.
std::int64_t steps(Depth depth, const std::byte* at) noexcept {
  if (depth == Depth::u8) return std::to_integer<std::int64_t>(*at);
  std::uint16_t v;
  std::memcpy(&v, at, sizeof v);
  return v;
}

float float_sample(Depth depth, const std::byte* at) noexcept {
  if (depth == Depth::half) {
    std::uint16_t v;
    std::memcpy(&v, at, sizeof v);
    return half_to_float(v);
  }
  float v;
  std::memcpy(&v, at, sizeof v);
  return v;
}

/// A colour without its alpha, as the depth holds it; where there is no alpha it stays as it is.
float without_alpha(Depth depth, float colour, float alpha) noexcept {
  if (alpha == 0) return colour;
  const float straight = colour / alpha;
  constexpr float kLargest = std::numeric_limits<float>::max();
  if (!std::isfinite(straight)) return std::copysign(kLargest, straight);
  const float rounded = half_to_float(float_to_half(straight));
  return depth == Depth::half && std::isfinite(rounded) ? rounded : straight;
}

/// Weighted float samples of one channel, summed in integers.
class FloatSum {
 public:
  void add(std::int32_t weight, float sample) noexcept {
    const auto bits = std::bit_cast<std::uint32_t>(sample);
    // sample = mantissa * 2^(exponent - 150), subnormals included.
    const auto exponent = static_cast<int>(std::max(bits >> 23 & 0xFFU, 1U));
    const std::int64_t mantissa = (bits & 0x7FFFFFU) | ((bits >> 23 & 0xFFU) != 0 ? 0x800000U : 0U);
    products_[count_] = weight * ((bits >> 31) != 0 ? -mantissa : mantissa);
    exponents_[count_++] = exponent;
    if (mantissa != 0) largest_ = std::max(largest_, exponent);
  }

  double over(std::int32_t total) const noexcept {
    Wide sum = 0;  // 16 products of 46 bits, in steps 2^64 finer than the largest sample's
    for (std::size_t i = 0; i < count_; ++i) {
      const int up = exponents_[i] - largest_ + kFiner;
      if (up >= 0)
        sum += static_cast<Wide>(products_[i]) * (Wide{1} << up);
      else if (up > -kFiner)
        sum += products_[i] >> -up;
    }
    return std::ldexp(static_cast<double>(sum) / total, largest_ - 150 - kFiner);
  }

 private:
  __extension__ typedef __int128 Wide;
  static constexpr int kFiner = 64;
  std::array<std::int64_t, 16> products_;
  std::array<int, 16> exponents_;
  std::size_t count_ = 0;
  int largest_ = 1;
};

const std::byte* first_tap(const std::byte* tile, int column, int row, const Taps& taps,
                           std::size_t texel) noexcept {
  const int at = (row + taps.first + store::kApron) * store::kColourTileEdge + column + taps.first +
                 store::kApron;
  return tile + static_cast<std::size_t>(at) * texel;
}

}  // namespace

void tent(double u, double v, Taps& taps) noexcept {
  taps.first = 0;
  taps.size = 2;
  const auto step = [](double w) { return static_cast<std::int32_t>(w * kWeightSteps + 0.5); };
  taps.weights[0] = step((1 - u) * (1 - v));
  taps.weights[1] = step(u * (1 - v));
  taps.weights[2] = step((1 - u) * v);
  taps.weights[3] = step(u * v);
  taps.total = taps.weights[0] + taps.weights[1] + taps.weights[2] + taps.weights[3];
}

namespace {

/// What the taps that count see of a float image.
struct FloatTaps {
  std::array<const std::byte*, 16> texels;
  std::array<std::int32_t, 16> weights;
  std::size_t count = 0;
};

Blended blend_floats(const store::ColourDirectory& image, const FloatTaps& taps, std::int32_t total,
                     BlendAlpha alpha) noexcept {
  const std::size_t sample = store::depth_bytes(image.depth);
  const bool divides = image.premultiplied && alpha == BlendAlpha::straight;
  const std::size_t last = image.channels - 1;
  Blended out{};
  for (std::size_t c = 0; c < image.channels; ++c) {
    const auto value = [&](std::size_t tap) {
      const float v = float_sample(image.depth, taps.texels[tap] + c * sample);
      return divides && c != last
                 ? without_alpha(image.depth, v,
                                 float_sample(image.depth, taps.texels[tap] + last * sample))
                 : v;
    };
    if (taps.count == 1) {
      out[c] = static_cast<double>(value(0));
      continue;
    }
    FloatSum sum;
    for (std::size_t tap = 0; tap < taps.count; ++tap) sum.add(taps.weights[tap], value(tap));
    out[c] = sum.over(total);
  }
  return out;
}

Blended blend_integers(const store::ColourDirectory& image, const std::byte* first,
                       const Taps& taps) noexcept {
  const std::size_t texel = image.texel_bytes(), sample = store::depth_bytes(image.depth);
  std::array<std::int64_t, 4> sums{};
  for (int y = 0; y < taps.size; ++y) {
    for (int x = 0; x < taps.size; ++x) {
      const std::int64_t weight = taps.weights[static_cast<std::size_t>(y * taps.size + x)];
      const std::byte* const at =
          first + static_cast<std::size_t>(y * store::kColourTileEdge + x) * texel;
      for (std::size_t c = 0; c < image.channels; ++c)
        sums[c] += weight * steps(image.depth, at + c * sample);
    }
  }
  Blended out{};
  const double total = taps.total * (image.depth == Depth::u8 ? 255.0 : 65535.0);
  for (std::size_t c = 0; c < image.channels; ++c) out[c] = static_cast<double>(sums[c]) / total;
  return out;
}

}  // namespace

Blended blend(const store::ColourDirectory& image, const std::byte* tile, int column, int row,
              const Taps& taps, BlendAlpha alpha) noexcept {
  const std::size_t texel = image.texel_bytes();
  const std::byte* const first = first_tap(tile, column, row, taps, texel);
  if (image.depth == Depth::u8 || image.depth == Depth::u16)
    return blend_integers(image, first, taps);
  FloatTaps floats;
  for (int y = 0; y < taps.size; ++y) {
    for (int x = 0; x < taps.size; ++x) {
      const std::int32_t weight = taps.weights[static_cast<std::size_t>(y * taps.size + x)];
      if (weight == 0) continue;
      floats.texels[floats.count] =
          first + static_cast<std::size_t>(y * store::kColourTileEdge + x) * texel;
      floats.weights[floats.count++] = weight;
    }
  }
  return blend_floats(image, floats, taps.total, alpha);
}

namespace {

template <std::size_t kChannels>
void blend_u8_channels(const std::byte* tile, int column, int row, const Taps& taps,
                       std::byte* out) noexcept {
  const std::byte* const first = first_tap(tile, column, row, taps, kChannels);
  std::array<std::int32_t, kChannels>
      sums{};  // 2^20 * 255 at most, and kernels with negative weights stay near it
  for (int y = 0; y < taps.size; ++y) {
    const std::byte* at = first + static_cast<std::size_t>(y * store::kColourTileEdge) * kChannels;
    for (int x = 0; x < taps.size; ++x, at += kChannels) {
      const std::int32_t weight = taps.weights[static_cast<std::size_t>(y * taps.size + x)];
      for (std::size_t c = 0; c < kChannels; ++c)
        sums[c] += weight * std::to_integer<std::int32_t>(at[c]);
    }
  }
  const double per_total = 1.0 / taps.total;
  for (std::size_t c = 0; c < kChannels; ++c) {
    const auto value = static_cast<std::int32_t>(sums[c] * per_total + 0.5);
    out[c] = static_cast<std::byte>(value < 0 ? 0 : value > 255 ? 255 : value);
  }
}

}  // namespace

void blend_u8(const store::ColourDirectory& image, const std::byte* tile, int column, int row,
              const Taps& taps, std::byte* out) noexcept {
  switch (image.channels) {
    case 1:
      return blend_u8_channels<1>(tile, column, row, taps, out);
    case 2:
      return blend_u8_channels<2>(tile, column, row, taps, out);
    case 3:
      return blend_u8_channels<3>(tile, column, row, taps, out);
    default:
      return blend_u8_channels<4>(tile, column, row, taps, out);
  }
}

}  // namespace pounce::projection
