// SPDX-License-Identifier: Apache-2.0
#include "points.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/bounds.h"
#include "image.h"
#include "pounce/error.h"

namespace pounce::score {
namespace {

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

void write_texture(const std::string& path, const Points& points,
                   const std::vector<Vec3d>& colours) {
  const std::size_t width = points.width, height = points.height;
  std::vector<Vec3d> image(width * height);
  std::vector<char> is_there(image.size(), 0);
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const std::size_t at = points.points[i].y * width + points.points[i].x;
    image[at] = colours[i];
    is_there[at] = 1;
  }
  constexpr int kPadding = 8;
  for (int ring = 0; ring < kPadding; ++ring) {
    const std::vector<char> before = is_there;
    for (std::size_t y = 0; y < height; ++y) {
      for (std::size_t x = 0; x < width; ++x) {
        if (before[y * width + x] != 0) continue;
        Vec3d sum;
        int count = 0;
        const auto look = [&](std::size_t nx, std::size_t ny) {
          if (nx >= width || ny >= height || before[ny * width + nx] == 0) return;
          sum = sum + image[ny * width + nx];
          ++count;
        };
        look(x - 1, y), look(x + 1, y), look(x, y - 1), look(x, y + 1);
        if (count == 0) continue;
        image[y * width + x] = sum * (1.0 / count);
        is_there[y * width + x] = 1;
      }
    }
  }
  write_image(path, points.width, points.height, image);
}

}  // namespace pounce::score
