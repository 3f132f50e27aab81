// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
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

/// A lossless WebP image in a file.
struct Vp8lHeader {
  std::uint32_t width = 0, height = 0;  ///< 1 to 16384
  std::uint64_t origin = 0;             ///< where the image begins in the file
  std::uint64_t stream_at = 0;          ///< where its bits do, behind its size
  std::uint64_t stream_bytes = 0;
};

/// Reads the header of the WebP image in `bytes` bytes of `file` from `at`. `name` is what messages
/// call it. Throws Error(input) naming what it is instead (lossy, animated, no WebP at all, cut
/// off) and the cure, Error(storage).
Vp8lHeader read_vp8l_header(const ReadFile& file, std::uint64_t at, std::uint64_t bytes,
                            const std::string& name);

/// Decodes a lossless WebP image row by row, without holding it: RFC 9649. Not thread-safe.
///
/// Memory does not grow with the number of pixels beyond 2^20: 4 MiB for what copies may reach
/// back to, at most 32 MiB for prefix codes (more are refused; encoders of today stay far below),
/// and less than 400 KiB besides. Values per block (predictors, factors between colours, groups of
/// codes) go to a scratch file: 6 bytes per 16 pixels at most, so no more than 96 MiB.
class Vp8lDecoder {
 public:
  /// Bytes read ahead, rows of pixels, rows of blocks, and the codes of an image of blocks.
  static constexpr std::uint64_t kRowBytes = 400 << 10;
  static constexpr std::uint64_t kMostBytes =
      PixelRing::kMostPixels * 4 + Vp8lPixels::kMostCodeBytes + kRowBytes;

  /// Reads all that comes before the pixels. `file` and `scratch` must outlive this; nobody else
  /// may append to the scratch file meanwhile. Throws Error(input), Error(storage).
  Vp8lDecoder(const ReadFile& file, const Vp8lHeader& header, const std::string& name,
              WriteFile& scratch);

  /// The next row as red, green, blue, alpha (straight, not multiplied into the colours), 4 * width
  /// bytes; `height` times at most. Throws Error(input) where the image is damaged, Error(storage).
  void read_row(std::span<std::uint8_t> rgba);
  /// What this takes, no more than kMostBytes.
  std::uint64_t memory_bytes() const;

 private:
  void read_transforms(WriteFile& scratch);

  Vp8lHeader header_;
  std::string name_;
  BitSource source_;
  PixelRing ring_;
  std::uint32_t stored_width_;
  std::vector<std::unique_ptr<Vp8lTransform>> transforms_;  ///< in the order they were applied
  std::unique_ptr<Vp8lPixels> pixels_;
  PixelRow row_;
  std::uint32_t next_row_ = 0;
};

}  // namespace pounce::io
