// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "pounce/options.h"

namespace pounce::fixture {

struct RenderSpec {
  std::uint32_t width = 0, height = 0;
  std::uint32_t channels = 3;  ///< 1..4; the last of 2 or 4 is straight alpha
  Depth depth = Depth::u8;
  bool is_data = false;  ///< numbers, not sRGB-coded colours: stored as they are in linear formats
};

/// Fills the row `y` (0 = top): width * channels values, 0 to 1, sRGB-coded for colours. Called
/// from several threads at once, for different rows.
using RenderRow = std::function<void(std::uint32_t y, std::span<float> row)>;

/// Writes an image of any size by the file's ending (png, jpg, exr, tif), in strips of rows worked
/// on by all threads; memory is O(width x strip). The depth becomes the nearest one that the format
/// has; EXR gets linear values. The same bytes at any number of threads. Throws Error(storage).
void render_image(const std::string& path, RenderSpec spec, const RenderRow& render_row);

}  // namespace pounce::fixture
