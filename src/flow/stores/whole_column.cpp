// SPDX-License-Identifier: Apache-2.0
//
// The rest of an image of which a job kept only the tiles that its mesh shows. It is built when a
// lookup first reaches beyond these, in the middle of a projection, so the rules are those of
// colour_levels.cpp: one maker at a time, under a lease that the job took beforehand. It differs in
// one point. Decoding and cutting run in parallel, hence the isolation.
//
// The bytes of a tile are the same in both columns, so it does not show which one a lookup used.
#include "flow/stores/whole_column.h"

#include <tbb/task_arena.h>

#include <mutex>

namespace pounce::flow {
namespace {

/// Of a request for some tiles, that for all.
ColourRequest all_of(ColourRequest request) {
  request.wanted = nullptr;
  return request;
}

}  // namespace

WholeColumn::WholeColumn(job::JobContext& job, const ColourRequest& request, const Hash128& key)
    : job_(job), request_(all_of(request)), key_(key) {}

store::ColourTile WholeColumn::tile(const store::ChunkRef& left_out) {
  const store::ColourStore& store = made();
  // The place of a tile that was left out is its number (whole_column.h). Shifted, it stays a
  // multiple of 8 like every offset: BlockCache uses the low bit.
  const std::uint64_t tile = (left_out.offset & ~kLeftOut) >> 3;
  const std::uint32_t columns = store.directory().tiles_x();
  const auto row = store.read_row(static_cast<std::uint32_t>(tile / columns), job_.compressor());
  return store.read_tile(row[tile % columns], job_.compressor());
}

const store::ColourStore& WholeColumn::made() {
  if (const auto* ready = ready_.load(std::memory_order_acquire)) return *ready;
  const std::lock_guard lock(job_.making);
  if (store_ == nullptr) {
    // Who waits for the parts of the building may not begin other work, which may want this lock.
    FoundColumn column =
        tbb::this_task_arena::isolate([this] { return whole_colours(job_, request_, key_); });
    if (!column.cached) ++job_.report.images_decoded;
    job_.count_store(column.store->pack(), column.cached);
    job_.report.source_store_bytes += column.store->pack().size_bytes();
    store_ = std::move(column.store);
    ready_.store(store_.get(), std::memory_order_release);
  }
  return *store_;
}

}  // namespace pounce::flow
