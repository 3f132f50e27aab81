// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "io/splats/vp8l_pixels.h"

namespace pounce::io {

/// A row of pixels, alpha << 24 | red << 16 | green << 8 | blue.
using PixelRow = std::vector<std::uint32_t>;

/// One of the ways in which an encoder prepares an image, undone row by row.
class Vp8lTransform {
 public:
  virtual ~Vp8lTransform() = default;
  /// Undoes row `y`; rows come in order. Grows the row where it held several pixels in one.
  virtual void undo(std::uint32_t y, PixelRow& row) = 0;
  /// The width of the image that is stored, where that of the result is `width`.
  virtual std::uint32_t stored_width(std::uint32_t width) const { return width; }
};

/// What a transform of an image, `width` x `height` pixels when it is undone, is read with.
struct Vp8lTransformInput {
  BitSource& source;
  std::uint32_t width, height;
  PixelRing& ring;
  WriteFile& scratch;
};

/// The kinds of transforms, by their number in the file.
enum class Vp8lTransformKind : std::uint32_t { predictor, cross_colour, subtract_green, palette };

/// Reads what a transform of this kind needs. Its blocks go into the scratch file. Throws
/// Error(input), Error(storage).
std::unique_ptr<Vp8lTransform> read_vp8l_transform(Vp8lTransformKind kind,
                                                   const Vp8lTransformInput& input);

}  // namespace pounce::io
