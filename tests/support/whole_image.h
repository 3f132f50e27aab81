// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "core/portable_math.h"
#include "io/image/read.h"
#include "io/image/write.h"

namespace pounce::test {

/// A whole image in memory: integers scaled to 0..1, floats as stored.
struct WholeImage {
  std::uint32_t width = 0, height = 0, channels = 0;
  bool linear = false;
  std::vector<double> samples;  ///< row-major, interleaved

  double at(std::size_t texel, std::size_t channel) const {
    return samples[texel * channels + channel];
  }
  /// The same texel as colour: gray stands for all three.
  double colour(std::size_t texel, std::size_t channel) const {
    return at(texel, channels < 3 ? 0 : channel);
  }
};

inline double sample_value(Depth depth, const std::byte* at) {
  std::uint16_t word = 0;
  float real = 0;
  switch (depth) {
    case Depth::u8:
      return std::to_integer<int>(*at) / 255.0;
    case Depth::u16:
      std::memcpy(&word, at, 2);
      return word / 65535.0;
    case Depth::half:
      std::memcpy(&word, at, 2);
      return static_cast<double>(half_to_float(word));
    case Depth::float32:
      break;
  }
  std::memcpy(&real, at, 4);
  return static_cast<double>(real);
}

inline WholeImage read_whole_image(const mesh::ImageRef& ref) {
  io::ImageReader reader(ref);
  const io::ImageInfo info = reader.info();
  std::vector<std::byte> rows(reader.row_bytes() * info.height);
  reader.read_rows(info.height, rows.data());
  WholeImage out{info.width, info.height, info.channels, info.linear, {}};
  out.samples.resize(std::size_t{info.width} * info.height * info.channels);
  const std::size_t size = rows.size() / out.samples.size();
  for (std::size_t i = 0; i < out.samples.size(); ++i)
    out.samples[i] = sample_value(info.depth, rows.data() + i * size);
  return out;
}

inline WholeImage read_whole_image(const std::string& path) {
  mesh::ImageRef ref;
  ref.path = path;
  ref.label = path;
  return read_whole_image(ref);
}

/// Writes samples of 0..1 as an 8-bit image.
inline void write_whole_image(const std::string& path, const WholeImage& image) {
  io::ImageWriter writer(path, {image.width, image.height, image.channels, Depth::u8, false,
                                image.channels == 2 || image.channels == 4});
  std::vector<std::byte> bytes(image.samples.size());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    bytes[i] = static_cast<std::byte>(std::lround(std::clamp(image.samples[i], 0.0, 1.0) * 255));
  writer.write_rows(image.height, bytes.data());
  writer.commit();
}

/// How alike the colours of two images of one size are where `mask` is not zero.
struct Score {
  double similarity = 0, psnr_db = 0;
  std::uint64_t texels = 0;
};
inline Score score(const WholeImage& a, const WholeImage& b,
                   const std::vector<std::uint8_t>& mask) {
  if (a.width != b.width || a.height != b.height || mask.size() != std::size_t{a.width} * a.height)
    throw std::runtime_error("images of different sizes are compared");
  double absolute = 0, squared = 0;
  Score out;
  for (std::size_t t = 0; t < mask.size(); ++t) {
    if (mask[t] == 0) continue;
    ++out.texels;
    for (std::size_t c = 0; c < 3; ++c) {
      const double d = a.colour(t, c) - b.colour(t, c);
      absolute += std::abs(d);
      squared += d * d;
    }
  }
  const double samples = 3.0 * static_cast<double>(out.texels);
  out.similarity = 1 - absolute / samples;
  out.psnr_db = -10 * std::log10(squared / samples);
  return out;
}

}  // namespace pounce::test
