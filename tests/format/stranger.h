// SPDX-License-Identifier: Apache-2.0
//
// A reader of payloads written from docs/tile-format.md alone: it shares no code with the library.
#pragma once

#include <algorithm>
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
  /// Which of a block's 4096 texels have a record.
  std::vector<bool> coverage() {
    const std::uint32_t runs = u32();
    std::vector<bool> covered;
    bool is = false;
    for (const std::uint32_t length : column(runs, 1, 2, false)) {
      covered.insert(covered.end(), length, is);
      is = !is;
    }
    return covered;
  }
  /// A column of records: integers of `size` bytes, each told by what it differs by from what its
  /// neighbours let expect.
  std::vector<std::int32_t> expected(const std::vector<bool>& covered, unsigned size) {
    const auto count = static_cast<std::size_t>(std::count(covered.begin(), covered.end(), true));
    const auto numbers = column(count, 1, size, false);
    const int spare = 32 - 8 * static_cast<int>(size);
    std::vector<std::int32_t> values, at(covered.size());
    for (std::size_t t = 0; t < covered.size(); ++t) {
      if (!covered[t]) continue;
      const bool left = t % 64 != 0 && covered[t - 1], above = t >= 64 && covered[t - 64];
      const bool corner = t % 64 != 0 && t >= 64 && covered[t - 65];
      std::int64_t value = values.empty() ? 0 : values.back();
      if (left && above && corner)
        value = std::int64_t{at[t - 1]} + at[t - 64] - at[t - 65];
      else if (!left && above)
        value = at[t - 64];
      const std::int64_t n = numbers[values.size()];
      value += n % 2 == 0 ? n / 2 : -(n + 1) / 2;
      const auto wrapped = static_cast<std::int32_t>(static_cast<std::uint32_t>(value) << spare);
      values.push_back(at[t] = wrapped >> spare);
    }
    return values;
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
