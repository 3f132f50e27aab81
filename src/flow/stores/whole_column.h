// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "flow/stores/build_stores.h"
#include "job/job_context.h"
#include "store/blocks/colour_store.h"

namespace pounce::flow {

/// All of an image of which only some tiles were kept: found in the cache or built when one of the
/// others is first asked for (by a footprint that reaches far, or by a smaller level). Thread-safe.
class WholeColumn {
 public:
  /// `job` and what `request` points to must outlive it. Of the memory that building takes
  /// (colour_least_bytes) the caller keeps one lease for all such columns of a job: one is built at
  /// a time.
  WholeColumn(job::JobContext& job, const ColourRequest& request, const Hash128& key);

  /// Stands for the place of a tile that was left out. No chunk of a pack has it.
  static store::ChunkRef left_out(std::uint64_t tile) { return {kLeftOut | tile << 3, 0, 0}; }
  /// The tile that left_out() stands for.
  store::ColourTile tile(const store::ChunkRef& left_out);

 private:
  static constexpr std::uint64_t kLeftOut = 1ULL << 63;
  const store::ColourStore& made();

  job::JobContext& job_;
  const ColourRequest request_;
  const Hash128 key_;
  std::unique_ptr<store::ColourStore> store_;
  std::atomic<const store::ColourStore*> ready_{nullptr};
};

}  // namespace pounce::flow
