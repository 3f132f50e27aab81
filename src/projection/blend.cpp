// SPDX-License-Identifier: Apache-2.0
#include "projection/blend.h"

#include <cstring>

#include "core/half.h"

namespace pounce::projection {
namespace {

constexpr double kWeightSteps = 1 << 20;
constexpr double kSampleSteps = 1 << 30;

/// A sample in whole steps: 0..255, 0..65535, or 2^-30 of the scale.
std::int64_t steps(const tiles::ColourDirectory& image, const std::byte* at) noexcept {
  switch (image.depth) {
    case Depth::u8:
      return std::to_integer<std::int64_t>(*at);
    case Depth::u16: {
      std::uint16_t v;
      std::memcpy(&v, at, sizeof v);
      return v;
    }
    case Depth::half: {
      std::uint16_t v;
      std::memcpy(&v, at, sizeof v);
      return std::llround(static_cast<double>(half_to_float(v)) / image.scale * kSampleSteps);
    }
    case Depth::float32:
      break;
  }
  float v;
  std::memcpy(&v, at, sizeof v);
  return std::llround(static_cast<double>(v) / image.scale * kSampleSteps);
}

double one(const tiles::ColourDirectory& image) noexcept {
  switch (image.depth) {
    case Depth::u8:
      return 255;
    case Depth::u16:
      return 65535;
    default:
      return kSampleSteps / image.scale;
  }
}

const std::byte* first_tap(const std::byte* tile, int column, int row, const Taps& taps,
                           std::size_t texel) noexcept {
  const int at = (row + taps.first + tiles::kApron) * tiles::kColourTileEdge + column + taps.first +
                 tiles::kApron;
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

Blended blend(const tiles::ColourDirectory& image, const std::byte* tile, int column, int row,
              const Taps& taps) noexcept {
  const std::size_t texel = image.texel_bytes(), sample = tiles::depth_bytes(image.depth);
  const std::byte* const first = first_tap(tile, column, row, taps, texel);
  std::array<std::int64_t, 4> sums{};
  for (int y = 0; y < taps.size; ++y) {
    for (int x = 0; x < taps.size; ++x) {
      const std::int64_t weight = taps.weights[static_cast<std::size_t>(y * taps.size + x)];
      const std::byte* const at =
          first + static_cast<std::size_t>(y * tiles::kColourTileEdge + x) * texel;
      for (std::size_t c = 0; c < image.channels; ++c)
        sums[c] += weight * steps(image, at + c * sample);
    }
  }
  Blended out{};
  const double total = taps.total * one(image);
  for (std::size_t c = 0; c < image.channels; ++c) out[c] = static_cast<double>(sums[c]) / total;
  return out;
}

namespace {

template <std::size_t kChannels>
void blend_u8_channels(const std::byte* tile, int column, int row, const Taps& taps,
                       std::byte* out) noexcept {
  const std::byte* const first = first_tap(tile, column, row, taps, kChannels);
  std::array<std::int32_t, kChannels>
      sums{};  // 2^20 * 255 at most, and kernels with negative weights stay near it
  for (int y = 0; y < taps.size; ++y) {
    const std::byte* at = first + static_cast<std::size_t>(y * tiles::kColourTileEdge) * kChannels;
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

void blend_u8(const tiles::ColourDirectory& image, const std::byte* tile, int column, int row,
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
