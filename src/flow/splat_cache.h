// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "flow/job_context.h"
#include "source/splat_set.h"
#include "tiles/splat_store.h"

namespace pounce::flow {

/// Prepared blocks of a splat store: from what the leases leave of the budget, else read, checked
/// and prepared. Two threads that miss at once both read. Thread-safe.
class SplatCache {
 public:
  SplatCache(JobContext& job, const tiles::SplatStore& store) : job_(job), store_(store) {}
  ~SplatCache();

  using Index = std::vector<tiles::SplatEntry>;
  std::shared_ptr<const Index> index(std::uint32_t tile);
  std::shared_ptr<const source::SplatSet> set(const tiles::SplatEntry& entry);
  std::uint64_t tiles_read() const { return tiles_read_; }  ///< whose index pages were read so far

 private:
  JobContext& job_;
  const tiles::SplatStore& store_;
  std::atomic<std::uint64_t> tiles_read_{0};
};

}  // namespace pounce::flow
