// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "io/files/asset_file.h"
#include "pounce/options.h"

namespace pounce::io {

/// Binary PNM: grey (P5) or RGB (P6) of 8 or 16 bits, the first of the file's images.
class PnmPicture {
 public:
  /// Throws Error(input) where the header is damaged or the file is cut off.
  explicit PnmPicture(ByteSource& bytes);

  std::uint32_t width() const { return width_; }
  std::uint32_t height() const { return height_; }
  std::uint32_t channels() const { return channels_; }
  Depth depth() const { return largest_ > 255 ? Depth::u16 : Depth::u8; }
  /// Rows from `first` on, native endian, scaled to the whole range. What cannot be read is 0, and
  /// the bytes say so.
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows);

 private:
  std::uint64_t row_bytes() const;

  ByteSource& bytes_;
  std::uint32_t width_ = 0, height_ = 0, channels_ = 0, largest_ = 0;
  std::uint64_t begin_ = 0;  ///< of the first row
};

}  // namespace pounce::io
