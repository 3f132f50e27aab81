// SPDX-License-Identifier: Apache-2.0
#include "io/image/sample.h"

#include <cstdint>
#include <cstring>

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

}  // namespace pounce::io
