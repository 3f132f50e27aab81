// SPDX-License-Identifier: Apache-2.0
#include "projection/blend.h"

#include <cmath>
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

}  // namespace

Blended blend_tent(const tiles::ColourDirectory& image, const std::byte* tile, double x,
                   double y) noexcept {
  const double left = std::floor(x), top = std::floor(y);
  const double u = x - left, v = y - top;
  const std::array<std::int64_t, 4> weights{
      static_cast<std::int64_t>((1 - u) * (1 - v) * kWeightSteps + 0.5),
      static_cast<std::int64_t>(u * (1 - v) * kWeightSteps + 0.5),
      static_cast<std::int64_t>((1 - u) * v * kWeightSteps + 0.5),
      static_cast<std::int64_t>(u * v * kWeightSteps + 0.5)};
  const std::size_t texel = image.texel_bytes();
  const auto column = static_cast<std::size_t>(static_cast<int>(left) + tiles::kApron);
  const auto row = static_cast<std::size_t>(static_cast<int>(top) + tiles::kApron);
  const std::byte* const first = tile + (row * tiles::kColourTileEdge + column) * texel;
  const std::array<const std::byte*, 4> taps{first, first + texel,
                                             first + tiles::kColourTileEdge * texel,
                                             first + (tiles::kColourTileEdge + 1) * texel};
  const std::size_t sample = tiles::depth_bytes(image.depth);
  const double total =
      static_cast<double>(weights[0] + weights[1] + weights[2] + weights[3]) * one(image);
  Blended out{};
  for (std::size_t c = 0; c < image.channels; ++c) {
    std::int64_t sum = 0;
    for (std::size_t k = 0; k < 4; ++k) sum += weights[k] * steps(image, taps[k] + c * sample);
    out[c] = static_cast<double>(sum) / total;
  }
  return out;
}

}  // namespace pounce::projection
