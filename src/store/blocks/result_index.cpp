// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/result_index.h"

#include <algorithm>

namespace pounce::store {

ResultIndex::ResultIndex(const mesh::Lattice& page, std::size_t channels)
    : grid_(page, channels),
      made_(grid_.blocks(), false),
      blocks_(channels, std::vector<ChunkRef>(grid_.blocks())) {
  covered.assign(channels, 0);
  clipped.assign(channels, 0);
}

std::uint64_t ResultIndex::size_bytes(const mesh::Lattice& page, std::size_t channels) {
  const std::uint64_t blocks = ResultGrid(page, channels).blocks();
  return blocks * sizeof(ChunkRef) * channels + blocks / 8 + 8;
}

bool ResultIndex::fits(const ResultRecord& record, std::size_t chunks) const {
  return record.chunks() == chunks &&
         std::none_of(record.blocks.begin(), record.blocks.end(),
                      [&](const ResultRecord::Block& block) { return has(block.x, block.y); });
}

bool ResultIndex::take(const ResultRecord& record, std::span<const ChunkRef> chunks) {
  if (!fits(record, chunks.size())) return false;
  auto next = chunks.begin();
  for (const ResultRecord::Block& block : record.blocks) {
    made_[grid_.slot(block.x, block.y)] = true;
    for (std::size_t c = 0; c < grid_.channels; ++c) {
      if (block.has_chunk[c]) chunk(c, block.x, block.y) = *next++;
    }
  }
  add(record.counts);
  texels_ += record.texels();
  return true;
}

}  // namespace pounce::store
