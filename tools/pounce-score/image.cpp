// SPDX-License-Identifier: Apache-2.0
#include "image.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/portable_math.h"
#include "io/image/read.h"
#include "io/image/write.h"

namespace pounce::score {
namespace {

template <class T>
T sample_at(const std::vector<std::byte>& row, std::size_t i) {
  T value;
  std::memcpy(&value, row.data() + i * sizeof value, sizeof value);
  return value;
}

float as_real(const std::vector<std::byte>& row, std::size_t i, Depth depth) {
  switch (depth) {
    case Depth::u8:
      return static_cast<float>(sample_at<std::uint8_t>(row, i)) / 255;
    case Depth::u16:
      return static_cast<float>(sample_at<std::uint16_t>(row, i)) / 65535;
    case Depth::half:
      return half_to_float(sample_at<std::uint16_t>(row, i));
    case Depth::float32:
      break;
  }
  return sample_at<float>(row, i);
}

Image read_all(io::ImageReader reader) {
  const io::ImageInfo& info = reader.info();
  Image image{info.width, info.height, info.channels, {}};
  std::vector<std::byte> row(reader.row_bytes());
  const std::size_t samples = std::size_t{image.width} * image.channels;
  image.samples.reserve(samples * image.height);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    reader.read_rows(1, row.data());
    for (std::size_t i = 0; i < samples; ++i) image.samples.push_back(as_real(row, i, info.depth));
  }
  return image;
}

}  // namespace

Image read_image(const std::string& path) { return read_all(io::ImageReader(path)); }
Image read_image(const mesh::ImageRef& ref) { return read_all(io::ImageReader(ref)); }

void write_image(const std::string& path, std::uint32_t width, std::uint32_t height,
                 const std::vector<Vec3d>& colours) {
  io::ImageWriter writer(path, {.width = width, .height = height, .channels = 3});
  std::vector<std::byte> samples;
  for (const Vec3d& c : colours) {
    for (const double v : {c.x, c.y, c.z})
      samples.push_back(static_cast<std::byte>(std::lround(255 * std::clamp(v, 0.0, 1.0))));
  }
  writer.write_rows(height, samples.data());
  writer.commit();
}

}  // namespace pounce::score
