// SPDX-License-Identifier: Apache-2.0
#include "points.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include "core/box.h"
#include "core/half.h"
#include "io/image/read.h"
#include "pounce/error.h"

namespace pounce::score {
namespace {

struct Image {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::vector<float> samples;

  Vec3d at(std::size_t x, std::size_t y) const {
    const float* const s = &samples[(y * width + x) * channels];
    if (channels < 3) return {s[0], s[0], s[0]};
    return {s[0], s[1], s[2]};
  }
};

/// Samples as real numbers, 0..1 for whole ones.
Image read_image(const std::string& path) {
  io::ImageReader reader(path);
  const io::ImageInfo& info = reader.info();
  Image image{info.width, info.height, info.channels, {}};
  std::vector<std::byte> row(reader.row_bytes());
  image.samples.reserve(std::size_t{image.width} * image.height * image.channels);
  const auto sample = [&](std::size_t i) -> float {
    const auto as = [&]<class T>(T) {
      T value;
      std::memcpy(&value, row.data() + i * sizeof value, sizeof value);
      return value;
    };
    switch (info.depth) {
      case Depth::u8:
        return static_cast<float>(as(std::uint8_t{})) / 255;
      case Depth::u16:
        return static_cast<float>(as(std::uint16_t{})) / 65535;
      case Depth::half:
        return half_to_float(as(std::uint16_t{}));
      case Depth::float32:
        break;
    }
    return as(0.0F);
  };
  for (std::uint32_t y = 0; y < image.height; ++y) {
    reader.read_rows(1, row.data());
    for (std::size_t i = 0; i < std::size_t{image.width} * image.channels; ++i)
      image.samples.push_back(sample(i));
  }
  return image;
}

std::string map_path(const std::string& pattern, const std::string& channel) {
  constexpr std::string_view kMark = "<CHANNEL>";
  const std::size_t at = pattern.find(kMark);
  if (at == std::string::npos)
    throw Error(ErrorKind::usage, pattern + ": needs <CHANNEL>, as `pounce maps -o` does");
  return pattern.substr(0, at) + channel + pattern.substr(at + kMark.size());
}

}  // namespace

Points read_points(const std::string& maps, std::size_t most) {
  const Image position = read_image(map_path(maps, "position")),
              normal = read_image(map_path(maps, "normal")),
              mask = read_image(map_path(maps, "mask"));
  Points out;
  out.width = mask.width;
  out.height = mask.height;
  const auto covered = [&](std::size_t x, std::size_t y) {
    return x < mask.width && y < mask.height && mask.at(x, y).x > 0.5;
  };
  std::vector<Point> all;
  Box3f box;
  for (std::uint32_t y = 0; y < mask.height; ++y) {
    for (std::uint32_t x = 0; x < mask.width; ++x) {
      if (!covered(x, y)) continue;
      Point p{position.at(x, y), normal.at(x, y), 0, x, y};
      box.extend(Vec3f(p.position));
      // The square root of a texel's area; a chart's last texel has its neighbours' on one side.
      double product = 1;
      int sides = 0;
      for (const bool along : {true, false}) {
        std::optional<double> step;
        for (const int by : {1, -1}) {
          const std::size_t nx = x + static_cast<std::size_t>(along ? by : 0),
                            ny = y + static_cast<std::size_t>(along ? 0 : by);
          if (!covered(nx, ny)) continue;
          const double here = length(position.at(nx, ny) - p.position);
          step = step ? std::min(*step, here) : here;
        }
        if (!step) continue;
        product *= *step;
        ++sides;
      }
      if (sides == 0) continue;
      p.edge = sides == 2 ? std::sqrt(product) : product;
      all.push_back(p);
    }
  }
  if (all.empty()) throw Error(ErrorKind::input, maps + ": no texel is covered");
  out.diagonal = length(Vec3d(box.hi) - Vec3d(box.lo));
  const std::size_t count = std::min(most, all.size());
  for (std::size_t i = 0; i < count; ++i) out.points.push_back(all[i * all.size() / count]);
  return out;
}

std::vector<Vec3d> read_colours(const std::string& path, const Points& points) {
  const Image image = read_image(path);
  if (image.width != points.width || image.height != points.height)
    throw Error(ErrorKind::input, path + ": has another size than the maps");
  std::vector<Vec3d> colours;
  for (const Point& p : points.points) colours.push_back(image.at(p.x, p.y));
  return colours;
}

}  // namespace pounce::score
