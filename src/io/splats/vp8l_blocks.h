// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/file.h"

namespace pounce::io {

/// One value per block of an image: written row by row into a scratch file, read again in order
/// with one row in memory. Blocks are squares of 4 to 512 pixels, so the largest image has 4096
/// rows of 4096 of them.
template <class Value>
class Vp8lBlocks {
 public:
  /// Blocks of 2^`bits` pixels of an image `width` pixels wide. `scratch` must outlive this.
  Vp8lBlocks(std::uint32_t width, std::uint32_t bits, WriteFile& scratch)
      : bits_(bits), scratch_(scratch), begin_(scratch.size_bytes()), row_(size(width)) {}

  std::uint32_t bits() const { return bits_; }
  /// How many blocks cover so many pixels.
  std::uint32_t size(std::uint32_t pixels) const { return (pixels + (1U << bits_) - 1) >> bits_; }

  /// Adds the next row. Nothing else may be appended to the file before the last one.
  void append(std::span<const Value> row) { scratch_.append(std::as_bytes(row)); }
  /// The values for row `y` of pixels; all have been added.
  std::span<const Value> row(std::uint32_t y) {
    const std::uint32_t wanted = y >> bits_;
    if (wanted != held_) {
      if (reader_ == nullptr) reader_ = scratch_.reader();
      const auto bytes = std::as_writable_bytes(std::span(row_));
      reader_->read(begin_ + std::uint64_t{wanted} * bytes.size(), bytes);
      held_ = wanted;
    }
    return row_;
  }

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  std::uint32_t bits_;
  WriteFile& scratch_;
  std::unique_ptr<ReadFile> reader_;
  std::uint64_t begin_;
  std::vector<Value> row_;
  std::uint32_t held_ = kNone;
};

}  // namespace pounce::io
