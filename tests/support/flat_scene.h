// SPDX-License-Identifier: Apache-2.0
//
// A flat sheet onto itself at another size: what each target texel covers is known by arithmetic.
#pragma once

#include <cmath>
#include <cstring>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "core/portable_math.h"
#include "pounce/transfer.h"
#include "support/mesh_files.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {

/// A flat sheet over the unit square whose UVs are its plan, times `across` and `down`.
inline mesh::Mesh flat_sheet(float across = 1, float down = 1) {
  mesh::Mesh mesh;
  mesh.uv_sets.emplace_back();
  mesh.uv_present.emplace_back();
  for (const auto& [x, y] : {std::pair{0.0F, 0.0F}, {1.0F, 0.0F}, {1.0F, 1.0F}, {0.0F, 1.0F}}) {
    mesh.positions.push_back({x, y, 0});
    mesh.normals.push_back({0, 0, 1});
    mesh.uv_sets[0].push_back({x * across, (1 - y) * down});
  }
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// Waves that go on across the image's borders.
inline WholeImage waves(std::uint32_t width, std::uint32_t height) {
  WholeImage image{width, height, 3, false, {}};
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      for (const double waves : {3.0, 5.0, 9.0}) {
        const double turns = waves * ((x + 0.5) / width + (y + 0.5) / height);
        image.samples.push_back(0.5 + 0.5 * std::cos(2 * std::numbers::pi * turns));
      }
    }
  }
  return image;
}

/// The mean of what lies under each of `width` x `height` texels when `image` is laid over them
/// `repeats` times each way.
inline WholeImage box_means(const WholeImage& image, std::uint32_t width, std::uint32_t height,
                            int repeats = 1) {
  struct Part {
    std::size_t at;
    double share;
  };
  const auto parts = [&](std::uint32_t i, std::uint32_t count, std::uint32_t size) {
    std::vector<Part> out;
    const double scale = static_cast<double>(size) * repeats / count;
    const double begin = i * scale, end = (i + 1) * scale;
    for (double j = std::floor(begin); j < end; ++j) {
      const double share = std::min(end, j + 1) - std::max(begin, j);
      if (share > 0) out.push_back({static_cast<std::size_t>(j) % size, share / scale});
    }
    return out;
  };
  WholeImage out{width, height, image.channels, image.linear, {}};
  for (std::uint32_t y = 0; y < height; ++y) {
    const auto rows = parts(y, height, image.height);
    for (std::uint32_t x = 0; x < width; ++x) {
      const auto columns = parts(x, width, image.width);
      for (std::size_t c = 0; c < image.channels; ++c) {
        double sum = 0;
        for (const Part& row : rows) {
          for (const Part& column : columns)
            sum += row.share * column.share * image.at(row.at * image.width + column.at, c);
        }
        out.samples.push_back(sum);
      }
    }
  }
  return out;
}

/// Writes samples as they are, in half or float; a fourth channel is alpha that the colours are
/// multiplied by.
inline void write_floats(const std::string& path, const WholeImage& image, Depth depth) {
  const bool has_alpha = image.channels == 4;
  io::ImageWriter writer(
      path, {image.width, image.height, image.channels, depth, true, has_alpha, has_alpha, {}, {}});
  const std::size_t size = depth == Depth::half ? 2 : 4;
  std::vector<std::byte> bytes(image.samples.size() * size);
  for (std::size_t i = 0; i < image.samples.size(); ++i) {
    const auto value = static_cast<float>(image.samples[i]);
    const std::uint16_t half = float_to_half(value);
    std::memcpy(&bytes[i * size], depth == Depth::half ? static_cast<const void*>(&half) : &value,
                size);
  }
  writer.write_rows(image.height, bytes.data());
  writer.commit();
}

/// The sheet with a texture, and the sheet.
struct FlatScene {
  TempFolder folder;
  TransferOptions options;

  explicit FlatScene(const std::string& texture, Channel channel = Channel::base_color,
                     const mesh::Mesh& source = flat_sheet()) {
    write_glb(folder.file("source.glb"), source);
    write_glb(folder.file("target.glb"), flat_sheet());
    options.source = folder.file("source.glb");
    options.targets = {folder.file("target.glb")};
    options.material.textures = {{channel, folder.file(texture)}};
    options.channels.transferred = {channel};
    options.output = folder.file("out.png");
    options.resources.use_cache = false;
    options.resources.memory_bytes = 256 << 20;
  }
  std::string texture() const { return options.material.textures.front().path; }
};

}  // namespace pounce::test
