// SPDX-License-Identifier: Apache-2.0
#include "flow/source_cache.h"

#include <algorithm>

#include "flow/find_store.h"

namespace pounce::flow {
namespace {

std::uint64_t store_id(const void* store) { return reinterpret_cast<std::uintptr_t>(store); }

// Chunks start at multiples of 8: the low bits of an offset are free to say what was decoded.
constexpr std::uint64_t kIndexPage = 1;

}  // namespace

SourceCache::~SourceCache() {
  job_.budget.forget(store_id(&geometry_));
  for (const auto* column : columns_) job_.budget.forget(store_id(column));
}

std::shared_ptr<const SourceCache::Index> SourceCache::index(std::uint32_t tile) {
  const CacheKey key{store_id(&geometry_),
                     geometry_.directory().tiles[tile].index_page.offset | kIndexPage};
  if (auto kept = job_.budget.find(key)) return std::static_pointer_cast<const Index>(kept);
  auto made = std::make_shared<const Index>(geometry_.read_index(tile, job_.compressor()));
  ++tiles_read_;
  job_.budget.keep(key, made, made->size() * sizeof(tiles::BlockEntry));
  return made;
}

std::shared_ptr<const source::SourceBlock> SourceCache::block(const tiles::BlockEntry& entry) {
  const CacheKey key{store_id(&geometry_), entry.chunk.offset};
  if (auto kept = job_.budget.find(key))
    return std::static_pointer_cast<const source::SourceBlock>(kept);
  auto made = std::make_shared<const source::SourceBlock>(
      decoded_source(geometry_, entry, geometry_.read_block(entry, job_.compressor())));
  job_.budget.keep(key, made, source::SourceBlock::decoded_bytes(entry.triangles, entry.patches));
  return made;
}

std::shared_ptr<const tiles::ColourTile> SourceCache::colours(const tiles::ColourStore& column,
                                                              std::uint32_t tile_x,
                                                              std::uint32_t tile_y) {
  using Row = std::vector<tiles::ChunkRef>;
  const CacheKey row_key{store_id(&column),
                         column.directory().row_pages[tile_y].offset | kIndexPage};
  auto row = std::static_pointer_cast<const Row>(job_.budget.find(row_key));
  if (row == nullptr) {
    {
      const std::lock_guard lock(mutex_);
      if (std::find(columns_.begin(), columns_.end(), &column) == columns_.end())
        columns_.push_back(&column);
    }
    row = std::make_shared<const Row>(column.read_row(tile_y, job_.compressor()));
    job_.budget.keep(row_key, row, row->size() * sizeof(tiles::ChunkRef));
  }
  const tiles::ChunkRef& chunk = (*row)[tile_x];
  const CacheKey key{store_id(&column), chunk.offset};
  if (auto kept = job_.budget.find(key))
    return std::static_pointer_cast<const tiles::ColourTile>(kept);
  auto made = std::make_shared<const tiles::ColourTile>(column.read_tile(chunk, job_.compressor()));
  job_.budget.keep(key, made, column.tile_bytes());
  return made;
}

}  // namespace pounce::flow
