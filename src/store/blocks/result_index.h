// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/lattice.h"
#include "store/blocks/result_records.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// Which blocks of a page are made, where their results are, and what was counted in them. Not
/// thread-safe.
class ResultIndex : public ResultCounts {
 public:
  ResultIndex(const mesh::Lattice& page, std::size_t channels);
  /// Bytes of the index of a page.
  static std::uint64_t size_bytes(const mesh::Lattice& page, std::size_t channels);

  const ResultGrid& grid() const { return grid_; }
  bool has(std::int32_t x, std::int32_t y) const { return made_[grid_.slot(x, y)]; }
  /// Others make this block.
  void leave_out(std::int32_t x, std::int32_t y) { made_[grid_.slot(x, y)] = true; }
  /// Would take() take it?
  bool fits(const ResultRecord& record, std::size_t chunks) const;
  /// Counts as made what a record names; false, and nothing is counted, if it does not fit the
  /// chunks before it, or names what is made already.
  bool take(const ResultRecord& record, std::span<const ChunkRef> chunks);
  std::uint64_t texels() const { return texels_; }  ///< of the records that were taken
  /// The place of a block's results; raw_bytes == 0: nothing covered there, or not made.
  ChunkRef& chunk(std::size_t channel, std::int32_t x, std::int32_t y) {
    return blocks_[channel][grid_.slot(x, y)];
  }
  /// [channel][block_y * blocks_x + block_x]
  std::vector<std::vector<ChunkRef>>& blocks() { return blocks_; }

 private:
  ResultGrid grid_;
  std::vector<bool> made_;
  std::vector<std::vector<ChunkRef>> blocks_;
  std::uint64_t texels_ = 0;
};

}  // namespace pounce::store
