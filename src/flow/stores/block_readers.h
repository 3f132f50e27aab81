// SPDX-License-Identifier: Apache-2.0
//
// How the three stores of a source are read for projection, and what keeps their decoded blocks
// from piece to piece, page to page and target to target.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "flow/stores/find_store.h"
#include "flow/stores/whole_column.h"
#include "gaussian/splat_set.h"
#include "job/job_context.h"
#include "runtime/block_cache.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/splat_store.h"
#include "surface/source_block.h"

namespace pounce::flow {

/// A store whose index has a part per spatial tile.
template <class Store, class BlockEntry, class Decoded>
struct TileReader {
  using Index = std::vector<BlockEntry>;
  using Entry = BlockEntry;
  using Block = Decoded;

  job::JobContext* job;
  std::unique_ptr<Store> store;

  Index read_index(std::uint32_t tile) const { return store->read_index(tile, job->compressor()); }
  static std::uint64_t index_bytes(const Index& index) { return index.size() * sizeof(Entry); }
  std::uint64_t index_place(std::uint32_t tile) const {
    return store->directory().tiles[tile].index_page.offset;
  }
  static std::uint64_t place(const Entry& entry) { return entry.chunk.offset; }
};

/// Facets and patches of a mesh.
struct SurfaceReader : TileReader<store::GeometryStore, store::BlockEntry, surface::SourceBlock> {
  bool with_attributes = false;

  Block read_block(const Entry& entry) const {
    return decoded_source(*store, entry, store->read_block(entry, job->compressor()),
                          with_attributes);
  }
  std::uint64_t block_bytes(const Entry& entry) const {
    return Block::decoded_bytes(entry.triangles, entry.patches, with_attributes);
  }
};
using SurfaceCache = runtime::BlockCache<SurfaceReader>;

/// Gaussians, of a splat scene or of a mesh's texels.
struct SplatReader : TileReader<store::SplatStore, store::SplatEntry, gaussian::SplatSet> {
  SphericalHarmonics harmonics = SphericalHarmonics::mean;

  Block read_block(const Entry& entry) const {
    return gaussian::make_splat_set(store->read_block(entry, job->compressor()), harmonics);
  }
  std::uint64_t block_bytes(const Entry& entry) const {
    return Block::most_bytes(entry.splats, store->directory().lobes);
  }
};
using SplatCache = runtime::BlockCache<SplatReader>;

/// Texels of an image; a part of its index is a row of tiles. Tiles that its store left out come
/// from the whole image.
struct ColourReader {
  using Index = std::vector<store::ChunkRef>;
  using Entry = store::ChunkRef;
  using Block = store::ColourTile;

  job::JobContext* job;
  std::unique_ptr<store::ColourStore> store;
  std::shared_ptr<WholeColumn> whole;  ///< null where the store has every tile

  Index read_index(std::uint32_t row) const {
    Index index = store->read_row(row, job->compressor());
    for (std::uint64_t x = 0; whole != nullptr && x < index.size(); ++x) {
      if (store::is_left_out(index[x]))
        index[x] = WholeColumn::left_out(std::uint64_t{row} * index.size() + x);
    }
    return index;
  }
  static std::uint64_t index_bytes(const Index& index) { return index.size() * sizeof(Entry); }
  Block read_block(const Entry& chunk) const {
    return whole != nullptr && store::is_left_out(chunk)
               ? whole->tile(chunk)
               : store->read_tile(chunk, job->compressor());
  }
  std::uint64_t block_bytes(const Entry&) const { return store->tile_bytes(); }
  std::uint64_t index_place(std::uint32_t row) const {
    return store->directory().row_pages[row].offset;
  }
  static std::uint64_t place(const Entry& chunk) { return chunk.offset; }
};
using ColourCache = runtime::BlockCache<ColourReader>;

}  // namespace pounce::flow
