// SPDX-License-Identifier: Apache-2.0
//
// Hits that outlive their search. What a page of a target hits on a source depends on both
// surfaces and on the search's limits alone, so the cache keeps it under their keys: another
// channel, a repainted texture or another filter is shaded without a search.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "flow/project/mesh.h"
#include "store/blocks/hit_store.h"

namespace pounce::flow {

/// May the hits of this projection be kept, or looked for? Only in a cache; not where the budget is
/// so tight that they would cost the search its memory; and not for channels of the surface itself,
/// which ask for more than hits say.
bool may_keep_hits(const job::JobContext& job, const MeshProjection& request);

/// Those that the cache has; null: the caller is to search, and to keep what it finds.
std::unique_ptr<store::HitStore> find_hits(job::JobContext& job, const MeshProjection& request);

/// Makes a page of hits that are known. Of the request, what its search was is not looked at.
std::unique_ptr<Projection> shade_known(job::JobContext& job, const MeshProjection& request,
                                        std::unique_ptr<store::HitStore> hits);
/// The least that this needs at once: one block, its colours (shading_bytes()).
std::uint64_t known_least_bytes(std::uint64_t result_texel_bytes, std::uint64_t lookup_bytes);

/// Keeps the hits of a page on their way from a search to its results. Where they cannot be stored
/// publish() says so as a warning: the job is done without.
class HitKeeper {
 public:
  HitKeeper(job::JobContext& job, const MeshProjection& request);
  /// Encodes the hits of a finished search into its work, and counts their distances. Thread-safe.
  void encode(HitWork& work, float max_distance) const;
  /// Stores what encode() made. Not thread-safe.
  void store(const PieceWork& work);
  void publish();  ///< after the last one
  void give_up();  ///< they will not be all there are, or nobody would find them
  bool is_wanted() const { return is_wanted_; }  ///< thread-safe

  /// Memory while a block is encoded, and of an encoded block until it is stored.
  static std::uint64_t scratch_bytes();
  static std::uint64_t block_bytes(const store::BlockEntry& entry);

 private:
  job::JobContext& job_;
  const store::HitStore::Facts facts_;
  /// Does a step of storing, and stores no more where the disk refuses it.
  template <typename Step>
  void while_stored(const Step& step);

  runtime::Lease index_lease_;
  std::unique_ptr<store::HitStoreWriter> writer_;  ///< null: refused
  std::atomic<bool> is_wanted_ = true;
  std::string refusal_;
};

}  // namespace pounce::flow
