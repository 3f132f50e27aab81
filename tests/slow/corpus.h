// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "pounce/options.h"
#include "support/random.h"

// Images of every kind that the decoders' own libraries can write, each with the samples that a
// reader must hand out.
namespace pounce::test::corpus {

/// An image as a reader hands it out: straight alpha, tightly packed, native endian.
struct Picture {
  std::uint32_t width = 0, height = 0, channels = 0;
  Depth depth = Depth::u8;
  bool has_alpha = false;
  std::vector<std::byte> samples;
};

/// What writes one file. It returns what must be read; nothing where no rule says what that is.
using Maker = std::function<std::optional<Picture>(const std::string& path, Random& random)>;

struct Entry {
  std::string name;      ///< of the entry: that of the file, and what is wanted of it
  std::string file;      ///< beside the others
  std::string channels;  ///< of an EXR: mesh::ImageRef::channels
  int part = 0;          ///< of an EXR: the part that these are in
  Maker make;            ///< null: the file is there already
};
using Entries = std::vector<Entry>;

/// An ICC profile of Display P3.
std::vector<std::byte> display_p3_profile();

void add_png(Entries& entries);
void add_jpeg(Entries& entries);
void add_tiff(Entries& entries);
void add_tiff_codings(Entries& entries);
void add_exr(Entries& entries);
void add_exr_parts(Entries& entries);
void add_webp(Entries& entries);
void add_other(Entries& entries);

/// What libwebp makes of a file. Throws std::runtime_error if it reads none.
Picture read_webp(const std::string& path);
/// The samples of a binary PPM of 8 or 16 bits. Throws std::runtime_error if it is none.
Picture read_ppm(const std::string& path);

inline void add(Entries& entries, const std::string& file, Maker make) {
  entries.push_back({file, file, "", 0, std::move(make)});
}

/// Whole numbers of 0..largest: a slope, noise on it, and the two ends now and then.
inline std::vector<std::uint32_t> whole_values(Random& random, std::size_t count,
                                               std::uint32_t largest) {
  std::vector<std::uint32_t> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double slope = static_cast<double>(i % 997) / 997.0;
    const double value = std::min(1.0, slope * 0.9 + random.unit() * 0.1);
    values[i] = static_cast<std::uint32_t>(value * largest + 0.5);
    if (random.one_in(5)) values[i] = static_cast<std::uint32_t>(random.below(largest + 1ULL));
    if (random.one_in(8)) values[i] = random.one_in(2) ? 0 : largest;
  }
  return values;
}

template <class Sample>
void append(std::vector<std::byte>& bytes, Sample sample) {
  static_assert(std::is_trivially_copyable_v<Sample>);
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof sample);
  std::memcpy(bytes.data() + at, &sample, sizeof sample);
}

/// A whole number of so many bits, as it is handed out: small ones scaled to 0..255.
inline void append_scaled(std::vector<std::byte>& bytes, std::uint32_t value, std::uint32_t bits) {
  if (bits == 16) return append(bytes, static_cast<std::uint16_t>(value));
  append(bytes, static_cast<std::uint8_t>(value * 255 / ((1U << bits) - 1)));
}

/// Rows of numbers of `bits` bits each, the first one highest, rows padded to bytes; of 16 bits the
/// higher byte first.
inline std::vector<std::uint8_t> packed(const std::vector<std::uint32_t>& values,
                                        std::size_t per_row, std::uint32_t bits) {
  std::vector<std::uint8_t> out;
  for (std::size_t i = 0; i < values.size(); i += per_row) {
    std::uint32_t held = 0, count = 0;
    for (std::size_t x = 0; x < per_row; ++x) {
      if (bits == 16) out.push_back(static_cast<std::uint8_t>(values[i + x] >> 8));
      if (bits >= 8) {
        out.push_back(static_cast<std::uint8_t>(values[i + x]));
        continue;
      }
      held = held << bits | values[i + x];
      count += bits;
      if (count == 8) {
        out.push_back(static_cast<std::uint8_t>(held));
        held = count = 0;
      }
    }
    if (count > 0) out.push_back(static_cast<std::uint8_t>(held << (8 - count)));
  }
  return out;
}

}  // namespace pounce::test::corpus
