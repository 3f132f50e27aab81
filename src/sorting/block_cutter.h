// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/page_pool.h"
#include "sorting/splat_sort.h"
#include "store/blocks/splat_block.h"

namespace pounce::sorting {

/// Blocks in order, cut from a merged sequence where neighbours are farthest apart. The cuts depend
/// on the sequence alone. Not thread-safe.
class BlockCutter {
 public:
  /// `merge` must outlive it; `lobes`: of the harmonics of every Gaussian.
  BlockCutter(SplatMerge& merge, std::uint32_t lobes);
  /// Its own, and a chunk of a run.
  static std::uint64_t most_bytes(std::uint32_t lobes);

  struct Cut {
    std::uint64_t ordinal = 0;
    std::uint64_t first_key = 0;
    PageVector<store::Splat> splats;
    PageVector<std::uint16_t> sh;
  };
  /// False at the end.
  bool next(Cut& cut);

 private:
  std::size_t halves() const { return std::size_t{3} * rows_.lobes; }

  SplatMerge& merge_;
  store::SplatRows rows_;  ///< merged, not cut yet
  PageVector<std::uint64_t> keys_;
  std::uint64_t next_ = 0;
};

}  // namespace pounce::sorting
