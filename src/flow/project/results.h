// SPDX-License-Identifier: Apache-2.0
//
// Results of one page on their way to its images: blocks of finished texels in a scratch pack,
// which a later run goes on with when this one dies.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/hash.h"
#include "flow/project/pieces.h"
#include "job/job_context.h"
#include "job/kept_encodings.h"
#include "job/part_files.h"
#include "job/step_pack.h"
#include "planning/plan.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/result_index.h"
#include "store/blocks/result_records.h"
#include "store/blocks/result_store.h"
#include "store/pack/pack.h"

namespace pounce::flow {

/// The results of one page.
struct PageResult : store::ResultCounts {
  std::unique_ptr<store::PackReader> pack;  ///< scratch; null of a part, which others read
  /// [channel][block_y * blocks_x + block_x]; raw_bytes == 0: nothing covered there.
  std::vector<std::vector<store::ChunkRef>> blocks;
  std::vector<NodeReport> nodes;  ///< of the graph that made it
  std::uint64_t written_bytes = 0;
  bool is_known = false;  ///< it came from the cache
};

/// What of a page is to be made.
struct ResultShare {
  TaskRole role = TaskRole::whole;
  std::uint32_t task = 1;
  const planning::StepShare* tasks = nullptr;  ///< null: the image is not cut
};

/// Collects the result blocks of one page, in any order, in a scratch pack. Not thread-safe.
class ResultCollector {
 public:
  /// `key`: of all that decides what the results are; what an earlier run left under it, or tasks
  /// whose parts are assembled, is there from the start.
  ResultCollector(job::JobContext& job, const store::GeometryStore& target, std::size_t channels,
                  const Hash128& key, const ResultShare& share = {});

  /// It is not to be made.
  bool has(const store::BlockEntry& entry) const { return index_.has(entry.x, entry.y); }
  std::uint64_t texels_left() const { return texels_left_; }  ///< to be made
  bool makes_all() const { return texels_left_ == target_.directory().texels; }
  /// Of an image that is assembled: those whose parts are not all there.
  const std::vector<std::uint32_t>& missing_tasks() const { return missing_tasks_; }
  std::uint64_t went_on_with() const { return went_on_with_; }  ///< texels that an earlier run made
  std::uint64_t store(const PieceWork& work);  ///< returns the bytes that were written
  PageResult finish();
  /// Instead: all of it, as the cache has it.
  PageResult take(store::ResultStore known);
  /// What was encoded of image `image` of the step, by this run or an earlier one; null where it is
  /// not worth keeping, as of a step that is quick.
  std::unique_ptr<io::EncodedBlocks> encodings(std::uint32_t image);
  /// What the results were made from is damaged.
  void forget() noexcept;
  /// The pack, for a caller whom a later run may still need it for; null where it was never kept.
  std::unique_ptr<job::StepPack> release() { return pack_->is_kept() ? std::move(pack_) : nullptr; }

 private:
  using Clock = std::chrono::steady_clock;

  void begin_part(const Hash128& key, const ResultShare& share);
  void take_parts(const Hash128& key, const ResultShare& share);
  job::StepPack::Earlier earlier();
  bool take_record(std::span<const std::byte> bytes);
  bool take_encoded(const store::ChunkRef& chunk, std::span<const std::byte> stored);
  void append_record(const PieceWork& work);
  store::PackWriter& writer() { return pack_ != nullptr ? pack_->writer() : *part_.writer; }
  std::chrono::milliseconds worked() const {
    return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - begun_);
  }

  job::JobContext& job_;
  const store::GeometryStore& target_;
  store::ResultIndex index_;  ///< of what was there, and the places of what is made
  runtime::Lease index_lease_;
  store::ResultCounts made_;              ///< by this run
  std::vector<store::ChunkRef> waiting_;  ///< chunks that no record has named yet
  std::uint64_t texels_left_ = 0, went_on_with_ = 0;
  std::vector<std::uint32_t> missing_tasks_;
  std::uint64_t earlier_ms_ = 0;  ///< that earlier runs have worked
  job::KeptBlocks encoded_;       ///< by an earlier run
  runtime::Lease encoded_lease_;
  std::unique_ptr<job::StepPack> pack_;  // reads what is there into all of the above
  job::PartFiles::NewPart part_;         ///< in its place: of an image that others assemble
  const Clock::time_point begun_ = Clock::now();
  Clock::time_point flushed_ = begun_, synced_ = begun_;
  std::vector<std::byte> record_;
};

}  // namespace pounce::flow
