// SPDX-License-Identifier: Apache-2.0
#include "flow/splat_cache.h"

namespace pounce::flow {
namespace {

std::uint64_t store_id(const void* store) { return reinterpret_cast<std::uintptr_t>(store); }

}  // namespace

SplatCache::~SplatCache() { job_.budget.forget(store_id(&store_)); }

std::shared_ptr<const SplatCache::Index> SplatCache::index(std::uint32_t tile) {
  // Chunks start at multiples of 8: a low bit of the offset tells pages of the index from blocks.
  const CacheKey key{store_id(&store_), store_.directory().tiles[tile].index_page.offset | 1};
  if (auto kept = job_.budget.find(key)) return std::static_pointer_cast<const Index>(kept);
  auto made = std::make_shared<const Index>(store_.read_index(tile, job_.compressor()));
  ++tiles_read_;
  job_.budget.keep(key, made, made->size() * sizeof(tiles::SplatEntry));
  return made;
}

std::shared_ptr<const source::SplatSet> SplatCache::set(const tiles::SplatEntry& entry) {
  const CacheKey key{store_id(&store_), entry.chunk.offset};
  if (auto kept = job_.budget.find(key))
    return std::static_pointer_cast<const source::SplatSet>(kept);
  auto made = std::make_shared<const source::SplatSet>(
      source::make_splat_set(store_.read_block(entry, job_.compressor())));
  job_.budget.keep(key, made, source::SplatSet::most_bytes(entry.splats));
  return made;
}

}  // namespace pounce::flow
