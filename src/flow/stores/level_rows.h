// SPDX-License-Identifier: Apache-2.0
//
// Of an image that is seen from afar: a smaller level in its place, of which no more than a strip
// is ever there.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/page_pool.h"
#include "io/image/read.h"
#include "planning/seen_images.h"
#include "shading/mip_levels.h"
#include "store/blocks/colour_store.h"

namespace pounce::flow {

/// Rows of a level of an image, made while the image's own go by.
class LevelRows {
 public:
  LevelRows(io::ImageReader& reader, const store::ColourDirectory& image, std::uint32_t level)
      : reader_(reader), image_(image), level_(level), row_bytes_(reader.row_bytes()) {
    if (level_ > 0) strip_.resize(row_bytes_ * kRows);
  }
  /// Of rows of the level.
  void read(std::uint32_t count, std::byte* to) {
    if (level_ == 0) return reader_.read_rows(count, to);
    while (count > 0) {
      const std::uint32_t rows = std::min(count, kRows >> level_);
      reader_.read_rows(rows << level_, strip_.data());
      // Each level takes the place of the one before, from its first row on.
      std::size_t row_bytes = row_bytes_;
      for (std::uint32_t level = 1; level <= level_; ++level, row_bytes /= 2) {
        const std::size_t texels = row_bytes / 2 / image_.texel_bytes();
        for (std::size_t y = 0; y < rows << (level_ - level); ++y) {
          const std::byte* const above = strip_.data() + 2 * y * row_bytes;
          shading::mean_of_fours(image_, above, above + row_bytes, texels,
                                 strip_.data() + y * row_bytes / 2);
        }
      }
      std::memcpy(to, strip_.data(), rows * row_bytes);
      to += rows * row_bytes;
      count -= rows;
    }
  }

 private:
  static constexpr std::uint32_t kRows = 1U << planning::kMostSeenLevel;  ///< of the image, at once

  io::ImageReader& reader_;
  const store::ColourDirectory& image_;
  const std::uint32_t level_;
  const std::size_t row_bytes_;  ///< of the image
  PageVector<std::byte> strip_;
};

}  // namespace pounce::flow
