// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"
#include "unwrap/outline.h"

namespace pounce::unwrap {

/// Cells [first, last) of a row.
struct Run {
  std::uint32_t first, last;
  std::uint32_t length() const { return last - first; }
};

/// Runs of cells, row by row.
class Rows {
 public:
  std::span<const Run> operator[](std::size_t row) const {
    return {runs_.data() + ends_[row], runs_.data() + ends_[row + 1]};
  }
  std::size_t size() const { return ends_.size() - 1; }
  /// Another row: the bits that are set.
  void append(std::span<const std::uint64_t> bits);
  std::uint64_t bytes() const {
    return runs_.capacity() * sizeof(Run) + ends_.capacity() * sizeof(std::uint32_t);
  }
  /// From the last row to the first, and each from right to left.
  Rows half_turned(std::uint32_t width) const;

 private:
  std::vector<Run> runs_;
  std::vector<std::uint32_t> ends_{0};
};

/// Windows of so many rows of a mask, one below the other, and what all rows of each have in
/// common: where that finds no room, the mask does not either, at as many heights.
struct Level {
  std::uint32_t rows = 1, first = 0;  ///< of each window; of the first one, where it begins
  Rows windows;
  std::vector<std::uint32_t> order;  ///< those that are not empty, what is hard to place first
};

/// Which cells a chart covers in one of its turns, and half a gutter around it.
struct Mask {
  std::vector<Level> levels;          ///< from many rows in a window to one
  std::size_t width = 0, height = 0;  ///< in cells
  double middle = 0;                  ///< of its cells, from its first row
  Vec2d origin;  ///< of its turned corners, in texels: where its first cell begins
  const Rows& rows() const { return levels.back().windows; }
  std::uint64_t bytes() const;
};

struct Cells {
  double step = 1;        ///< texels along each
  std::size_t count = 0;  ///< along the image
  double half = 0;        ///< of the gutter, in texels
};

/// Without levels where it is larger than the image.
Mask mask_of(const Outline& outline, const Turn& turn, double scale, const Cells& cells);
/// The same, turned by half a turn.
Mask half_turned(const Mask& mask, const Cells& cells);

}  // namespace pounce::unwrap
