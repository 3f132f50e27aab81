// SPDX-License-Identifier: Apache-2.0
//
// A reader of payloads written from docs/tile-format.md alone: it shares no code with the library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

namespace pounce::test {

/// Takes little-endian values off the front of a payload.
class Stranger {
 public:
  explicit Stranger(std::vector<std::byte> bytes) : bytes_(std::move(bytes)) {}

  std::uint64_t integer(unsigned size) {
    std::uint64_t value = 0;
    for (unsigned k = 0; k < size; ++k)
      value |= std::to_integer<std::uint64_t>(bytes_.at(at_ + k)) << (8 * k);
    at_ += size;
    return value;
  }
  std::uint32_t u32() { return static_cast<std::uint32_t>(integer(4)); }
  std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
  float f32() { return as_float(u32()); }

  /// A column of `rows` elements of `fields` integers of `size` bytes: planes, then differences.
  std::vector<std::uint32_t> column(std::size_t rows, std::size_t fields, unsigned size,
                                    bool differences = true) {
    const std::size_t count = rows * fields;
    std::vector<std::uint32_t> values(count, 0);
    for (unsigned plane = 0; plane < size; ++plane) {
      for (std::size_t i = 0; i < count; ++i)
        values[i] |= static_cast<std::uint32_t>(integer(1)) << (8 * plane);
    }
    const std::uint32_t mask = size == 4 ? 0xFFFFFFFFU : (1U << (8 * size)) - 1;
    for (std::size_t i = fields; differences && i < count; ++i)
      values[i] = (values[i] + values[i - fields]) & mask;
    return values;
  }
  /// Interleaved samples whose planes are those of a whole texel.
  std::vector<std::uint32_t> texels(std::size_t count, std::size_t channels, unsigned size) {
    const std::size_t texel_bytes = channels * size;
    std::vector<std::uint32_t> samples(count * channels, 0);
    for (std::size_t plane = 0; plane < texel_bytes; ++plane) {
      for (std::size_t t = 0; t < count; ++t) {
        samples[t * channels + plane / size] |= static_cast<std::uint32_t>(integer(1))
                                                << (8 * (plane % size));
      }
    }
    const std::uint32_t mask = size == 4 ? 0xFFFFFFFFU : (1U << (8 * size)) - 1;
    for (std::size_t i = channels; i < samples.size(); ++i)
      samples[i] = (samples[i] + samples[i - channels]) & mask;
    return samples;
  }
  std::size_t left() const { return bytes_.size() - at_; }

  static float as_float(std::uint32_t bits) {
    float value;
    std::memcpy(&value, &bits, 4);
    return value;
  }

 private:
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
};

inline std::vector<float> floats(const std::vector<std::uint32_t>& bits) {
  std::vector<float> values;
  for (const std::uint32_t b : bits) values.push_back(Stranger::as_float(b));
  return values;
}

}  // namespace pounce::test
