// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"
#include "mesh/mesh.h"

namespace pounce::score {

/// An image in memory, row 0 on top.
struct Image {
  std::uint32_t width = 0, height = 0, channels = 0;
  std::vector<float> samples;  ///< as stored, 0..1 for whole numbers

  /// The first three channels, or the first one three times.
  Vec3d at(std::size_t x, std::size_t y) const {
    const float* const s = &samples[(y * width + x) * channels];
    if (channels < 3) return {s[0], s[0], s[0]};
    return {s[0], s[1], s[2]};
  }
};

/// Throws pounce::Error.
Image read_image(const std::string& path);
Image read_image(const mesh::ImageRef& ref);

/// Writes colours as 8 bits per sample; the path's ending says as what. Throws pounce::Error.
void write_image(const std::string& path, std::uint32_t width, std::uint32_t height,
                 const std::vector<Vec3d>& colours);

}  // namespace pounce::score
