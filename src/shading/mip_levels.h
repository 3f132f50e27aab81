// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/page_pool.h"
#include "pounce/options.h"

namespace pounce::shading {

/// Levels of an image, itself included, down to 1 x 1.
std::uint32_t level_count(ImageSize size);

/// The smaller levels of an image, made while its rows go by from top to bottom: of each level two
/// rows are held. A texel is the mean of the four below it, or, where a side is odd, what a linear
/// filter finds there. Samples are averaged as they are coded, in single precision; each level is
/// made of the one before as it was before rounding. Not thread-safe.
class MipLevels {
 public:
  /// Takes a finished row of a level (1 is the first that is made), in the image's depth.
  using Take = std::function<void(std::uint32_t level, const std::byte* row)>;

  MipLevels(ImageSize size, std::uint32_t channels, Depth depth);
  /// The next rows of the image. Rows of a level come in order; those of all levels mix.
  void push(std::uint32_t rows, const std::byte* samples, const Take& take);
  static std::uint64_t memory_bytes(ImageSize size, std::uint32_t channels);

 private:
  struct Level {
    ImageSize from, size;            ///< of the level before, and its own
    std::uint32_t next_row = 0;      ///< to be made
    PageVector<float> above, below;  ///< rows of the level before, at this one's width
  };

  void accept(std::size_t level, std::uint32_t row, const float* samples, const Take& take);
  void narrow(const Level& level, const float* samples, float* out) const;
  void finish(std::size_t level, const Take& take);

  const ImageSize size_;
  const std::uint32_t channels_;
  const Depth depth_;
  std::uint32_t next_row_ = 0;
  std::vector<Level> levels_;  ///< from 1
  PageVector<float> row_;
  PageVector<std::byte> encoded_;
};

}  // namespace pounce::shading
