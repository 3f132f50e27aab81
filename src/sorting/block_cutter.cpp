// SPDX-License-Identifier: Apache-2.0
#include "sorting/block_cutter.h"

#include "store/blocks/splat_store.h"

namespace pounce::sorting {

using store::kMostSplatsPerBlock;

BlockCutter::BlockCutter(SplatMerge& merge, std::uint32_t lobes)
    : merge_(merge), rows_{lobes, {}, {}} {
  rows_.splats.reserve(2 * kMostSplatsPerBlock);
  rows_.sh.reserve(2 * kMostSplatsPerBlock * halves());
  keys_.reserve(2 * kMostSplatsPerBlock);
}

std::uint64_t BlockCutter::most_bytes(std::uint32_t lobes) {
  return 2 * round_to_pages(kMostSplatsPerBlock * (sizeof(store::Splat) + store::lobe_bytes(lobes) +
                                                   sizeof(std::uint64_t))) +
         SplatRunWriter::write_bytes(lobes);
}

bool BlockCutter::next(Cut& cut) {
  std::uint64_t key;
  // One more than a block holds shows that the sequence goes on. The cut leaves its rest for the
  // next block, so up to two blocks are held.
  while (keys_.size() <= kMostSplatsPerBlock && merge_.next(rows_, key)) keys_.push_back(key);
  if (keys_.empty()) return false;
  const bool ended = keys_.size() <= kMostSplatsPerBlock;
  const std::size_t count = store::splat_cut(keys_, kMostSplatsPerBlock, ended);
  cut.ordinal = next_++;
  cut.first_key = keys_.front();
  const auto end = static_cast<std::ptrdiff_t>(count);
  const auto sh_end = static_cast<std::ptrdiff_t>(count * halves());
  cut.splats.assign(rows_.splats.begin(), rows_.splats.begin() + end);
  cut.sh.assign(rows_.sh.begin(), rows_.sh.begin() + sh_end);
  rows_.splats.erase(rows_.splats.begin(), rows_.splats.begin() + end);
  rows_.sh.erase(rows_.sh.begin(), rows_.sh.begin() + sh_end);
  keys_.erase(keys_.begin(), keys_.begin() + end);
  return true;
}

}  // namespace pounce::sorting
