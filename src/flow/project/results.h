// SPDX-License-Identifier: Apache-2.0
//
// Results of one page on their way to its images: blocks of finished texels in a scratch pack,
// which a later run goes on with when this one dies.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/hash.h"
#include "flow/project/pieces.h"
#include "job/job_context.h"
#include "job/kept_encodings.h"
#include "job/step_pack.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/result_records.h"
#include "store/pack/pack.h"

namespace pounce::flow {

/// The results of one page.
struct PageResult : store::ResultCounts {
  std::unique_ptr<store::PackReader> pack;  ///< scratch; empty when the page has no texels
  /// [channel][block_y * blocks_x + block_x]; raw_bytes == 0: nothing covered there.
  std::vector<std::vector<store::ChunkRef>> blocks;
  std::vector<NodeReport> nodes;  ///< of the graph that made it
};

/// Collects the result blocks of one page, in any order, in a scratch pack. Not thread-safe.
class ResultCollector {
 public:
  /// `key`: of all that decides what the results are; what an earlier run left under it is there
  /// from the start.
  ResultCollector(job::JobContext& job, const store::GeometryStore& target, std::size_t channels,
                  const Hash128& key);

  /// An earlier run has made this block.
  bool has(const store::BlockEntry& entry) const { return made_[grid_.slot(entry.x, entry.y)]; }
  std::uint64_t kept_texels() const { return kept_texels_; }  ///< that an earlier run has made
  std::uint64_t store(const PieceWork& work);  ///< returns the bytes that were written
  PageResult finish();
  /// What was encoded of image `image` of the step, by this run or an earlier one; null where it is
  /// not worth keeping, as of a step that is quick.
  std::unique_ptr<io::EncodedBlocks> encodings(std::uint32_t image);
  /// The images are there, or what the results were made from is damaged.
  void forget() noexcept { pack_->forget(); }
  /// The pack, for a caller whom a later run may still need it for; null where it was never kept.
  std::unique_ptr<job::StepPack> release() { return pack_->is_kept() ? std::move(pack_) : nullptr; }
  /// Bytes of the index of a page's results.
  static std::uint64_t index_bytes(const mesh::Lattice& page, std::size_t channels);

 private:
  job::StepPack::Earlier earlier();
  bool take_record(std::span<const std::byte> bytes);
  bool take_encoded(const store::ChunkRef& chunk, std::span<const std::byte> stored);
  void append_record(const PieceWork& work);

  job::JobContext& job_;
  const store::GeometryStore& target_;
  const store::ResultGrid grid_;
  runtime::Lease index_lease_;
  PageResult result_;
  std::vector<bool> made_;                ///< by an earlier run
  std::vector<store::ChunkRef> waiting_;  ///< chunks that no record has named yet
  std::uint64_t kept_texels_ = 0;
  std::uint64_t earlier_ms_ = 0;  ///< that earlier runs have worked
  job::KeptBlocks encoded_;       ///< by an earlier run
  runtime::Lease encoded_lease_;
  std::unique_ptr<job::StepPack> pack_;  // reads what is there into all of the above
  std::vector<std::byte> record_;
};

}  // namespace pounce::flow
