// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "flow/job_context.h"
#include "source/source_block.h"
#include "tiles/colour_store.h"
#include "tiles/geometry_store.h"

namespace pounce::flow {

/// Decoded things of the source store: from what the leases leave of the budget, else read, checked
/// and decoded. Two threads that miss at once both decode: rarer than a lock would cost.
/// Thread-safe.
class SourceCache {
 public:
  SourceCache(JobContext& job, const tiles::GeometryStore& geometry)
      : job_(job), geometry_(geometry) {}
  ~SourceCache();

  using Index = std::vector<tiles::BlockEntry>;
  std::shared_ptr<const Index> index(std::uint32_t tile);
  std::uint64_t tiles_read() const { return tiles_read_; }  ///< whose index pages were read so far
  std::shared_ptr<const source::SourceBlock> block(const tiles::BlockEntry& entry);
  std::shared_ptr<const tiles::ColourTile> colours(const tiles::ColourStore& column,
                                                   std::uint32_t tile_x, std::uint32_t tile_y);

 private:
  JobContext& job_;
  const tiles::GeometryStore& geometry_;
  std::vector<const tiles::ColourStore*> columns_;  ///< seen so far, for forgetting
  std::atomic<std::uint64_t> tiles_read_{0};
  std::mutex mutex_;  ///< guards columns_
};

}  // namespace pounce::flow
