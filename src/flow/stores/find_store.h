// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "job/job_context.h"
#include "pounce/error.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/hit_store.h"
#include "store/blocks/splat_store.h"
#include "surface/source_block.h"

namespace pounce::flow {

/// Decodes all that a store holds. Throws Error(damaged_store) if anything of it is not what it
/// should be: checksums alone say nothing of packs that somebody else wrote.
void check_store(job::JobContext& job, const store::GeometryStore& store);
void check_store(job::JobContext& job, const store::ColourStore& store);
void check_store(job::JobContext& job, const store::SplatStore& store);
void check_store(job::JobContext& job, const store::HitStore& store);

/// Throws Error(damaged_store) if a source's largest blocks are smaller than it says: that it asks
/// for more memory than there is may be a lie.
void check_largest(job::JobContext& job, const store::GeometryStore& store);

/// A stored block of a source as projection uses it, which its index has announced.
surface::SourceBlock decoded_source(const store::GeometryStore& store,
                                    const store::BlockEntry& entry,
                                    const store::GeometryBlock& block,
                                    bool with_attributes = false);

/// The store that open(pack) makes of a pack of the cache; null if the caller is to make the pack
/// (store::StoreFolder::find). One that is damaged, or in a job that checks its packs has anything
/// damaged in it, is discarded with a warning.
template <class Open>
auto find_store(job::JobContext& job, store::PackKind kind, const Hash128& key, const Open& open)
    -> decltype(open(nullptr)) {
  while (auto pack = job.find_pack(kind, key)) {
    try {
      auto store = open(std::move(pack));
      if (job.check_packs) check_store(job, *store);
      return store;
    } catch (const Error& e) {
      if (e.kind() != ErrorKind::damaged_store) throw;
      const bool removed = job.stores->discard(kind, key);
      job.report.warnings.push_back(
          fmt::format("{} ({}; rebuilding it)", e.what(), removed ? "removed" : "ignored"));
    }
  }
  return nullptr;
}

}  // namespace pounce::flow
