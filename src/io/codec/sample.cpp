// SPDX-License-Identifier: Apache-2.0
#include "io/codec/sample.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>

#include "core/portable_math.h"

namespace pounce::io {
namespace {

template <class Sample>
void convert(std::size_t count, const std::byte* samples, double divisor, double* out) {
  for (std::size_t i = 0; i < count; ++i) {
    Sample sample;
    std::memcpy(&sample, samples + i * sizeof sample, sizeof sample);
    out[i] = static_cast<double>(sample) / divisor;
  }
}

}  // namespace

void samples_to_double(Depth depth, std::size_t count, const std::byte* samples, double* out) {
  switch (depth) {
    case Depth::u8:
      return convert<std::uint8_t>(count, samples, 255.0, out);
    case Depth::u16:
      return convert<std::uint16_t>(count, samples, 65535.0, out);
    case Depth::half:
      return convert<half>(count, samples, 1.0, out);
    case Depth::float32:
      return convert<float>(count, samples, 1.0, out);
  }
}

namespace {

template <class Sample>
void divide_integers(std::uint32_t channels, std::size_t texels, Sample* sample) {
  constexpr std::uint32_t kOne = std::numeric_limits<Sample>::max();
  for (std::size_t i = 0; i < texels; ++i, sample += channels) {
    const std::uint32_t alpha = sample[channels - 1];
    if (alpha == 0 || alpha == kOne) continue;
    for (std::uint32_t c = 0; c + 1 < channels; ++c) {
      sample[c] = static_cast<Sample>(std::min(kOne, (sample[c] * kOne + alpha / 2) / alpha));
    }
  }
}

template <class Sample>
void multiply_integers(std::uint32_t channels, std::size_t texels, Sample* sample) {
  constexpr std::uint64_t kOne = std::numeric_limits<Sample>::max();
  for (std::size_t i = 0; i < texels; ++i, sample += channels) {
    const std::uint64_t alpha = sample[channels - 1];
    for (std::uint32_t c = 0; c + 1 < channels; ++c)
      sample[c] = static_cast<Sample>((sample[c] * alpha + kOne / 2) / kOne);
  }
}

template <class Sample, class Operation>
void for_each_colour(std::uint32_t channels, std::size_t texels, Sample* sample,
                     Operation operation) {
  for (std::size_t i = 0; i < texels; ++i, sample += channels) {
    const float alpha = static_cast<float>(sample[channels - 1]);
    for (std::uint32_t c = 0; c + 1 < channels; ++c) {
      sample[c] = static_cast<Sample>(operation(static_cast<float>(sample[c]), alpha));
    }
  }
}

float divide(float colour, float alpha) { return alpha == 0 ? colour : colour / alpha; }
float multiply(float colour, float alpha) { return colour * alpha; }

}  // namespace

void divide_by_alpha(Depth depth, std::uint32_t channels, std::size_t texels, std::byte* samples) {
  switch (depth) {
    case Depth::u8:
      return divide_integers(channels, texels, reinterpret_cast<std::uint8_t*>(samples));
    case Depth::u16:
      return divide_integers(channels, texels, reinterpret_cast<std::uint16_t*>(samples));
    case Depth::half:
      return for_each_colour(channels, texels, reinterpret_cast<half*>(samples), divide);
    case Depth::float32:
      return for_each_colour(channels, texels, reinterpret_cast<float*>(samples), divide);
  }
}

void multiply_by_alpha(Depth depth, std::uint32_t channels, std::size_t texels,
                       std::byte* samples) {
  switch (depth) {
    case Depth::u8:
      return multiply_integers(channels, texels, reinterpret_cast<std::uint8_t*>(samples));
    case Depth::u16:
      return multiply_integers(channels, texels, reinterpret_cast<std::uint16_t*>(samples));
    case Depth::half:
      return for_each_colour(channels, texels, reinterpret_cast<half*>(samples), multiply);
    case Depth::float32:
      return for_each_colour(channels, texels, reinterpret_cast<float*>(samples), multiply);
  }
}

}  // namespace pounce::io
