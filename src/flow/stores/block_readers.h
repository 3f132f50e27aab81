// SPDX-License-Identifier: Apache-2.0
//
// How the three stores of a source are read for projection, and what keeps their decoded blocks
// from piece to piece, page to page and target to target.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "flow/stores/build_stores.h"
#include "gaussian/splat_columns.h"
#include "gaussian/splat_set.h"
#include "job/job_context.h"
#include "runtime/block_cache.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/splat_store.h"
#include "surface/source_block.h"

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

/// A store whose index has a part per spatial tile.
template <class Store, class BlockEntry, class Decoded>
struct TileReader {
  using Index = std::vector<BlockEntry>;
  using Entry = BlockEntry;
  using Block = Decoded;
  static constexpr bool kReadsAlone = true;

  job::JobContext* job;
  std::shared_ptr<Store> store;

  Index read_index(std::uint32_t tile) const { return store->read_index(tile, job->compressor()); }
  static std::uint64_t index_bytes(const Index& index) { return index.size() * sizeof(Entry); }
  std::uint64_t index_place(std::uint32_t tile) const {
    return store->directory().tiles[tile].index_page.offset;
  }
  static std::uint64_t place(const Entry& entry) { return entry.chunk.offset; }
};

/// Facets and patches of a mesh.
struct SurfaceReader : TileReader<store::GeometryStore, store::BlockEntry, surface::SourceBlock> {
  static constexpr runtime::Reuse reuse = runtime::Reuse::near;
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
  static constexpr runtime::Reuse reuse = runtime::Reuse::anywhere;
  SphericalHarmonics harmonics = SphericalHarmonics::mean;

  Block read_block(const Entry& entry) const {
    return gaussian::make_splat_set(store->read_block(entry, job->compressor()), harmonics);
  }
  std::uint64_t block_bytes(const Entry& entry) const {
    return Block::most_bytes(entry.splats, store->directory().lobes);
  }
};
using SplatCache = runtime::BlockCache<SplatReader>;

/// The same as views draw them.
struct DrawnReader : TileReader<store::SplatStore, store::SplatEntry, gaussian::SplatColumns> {
  static constexpr runtime::Reuse reuse = runtime::Reuse::anywhere;

  Block read_block(const Entry& entry) const {
    return gaussian::make_splat_columns(store->read_block(entry, job->compressor()));
  }
  std::uint64_t block_bytes(const Entry& entry) const {
    return Block::most_bytes(entry.splats, store->directory().lobes);
  }
};
using DrawnCache = runtime::BlockCache<DrawnReader>;

/// Of an image of 16 bits.
inline const std::uint16_t* samples_of(const store::ColourTile& tile) {
  return reinterpret_cast<const std::uint16_t*>(tile.data());
}

/// Texels of an image; a part of its index is a row of tiles. Tiles that its store left out come
/// from the whole image.
struct ColourReader {
  using Index = std::vector<store::ChunkRef>;
  using Entry = store::ChunkRef;
  using Block = store::ColourTile;
  static constexpr bool kReadsAlone = false;  // a whole image may have to be built

  job::JobContext* job;
  std::unique_ptr<store::ColourStore> store;
  std::shared_ptr<WholeColumn> whole;  ///< null where the store has every tile
  runtime::Reuse reuse = runtime::Reuse::near;

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

// --- smaller levels ------------------------------------------------------------------------------

/// Smaller versions of a job's images, each half as wide and high as the one before (rounded up):
/// columns of their own, found in the cache or made from the level before when they are first asked
/// for. Thread-safe.
class ColourLevels {
 public:
  explicit ColourLevels(job::JobContext& job) : job_(job) {}
  /// `column` is an image's own, `key` that of all of it; it must outlive this. Before any other
  /// use.
  void add(const ColourCache& column, const Hash128& key);
  /// The same image's `level` is there already. Before any other use, too.
  void add_made(const ColourCache& column, std::uint32_t level,
                std::unique_ptr<store::ColourStore> store);

  /// Level 1 or above of an image. Whoever asks first makes it; the others wait. Needs making_bytes
  /// of memory under the caller's lease. Throws as building a store does.
  const ColourCache& get(const ColourCache& column, std::uint32_t level);
  static std::uint64_t making_bytes(std::uint64_t tile_bytes) { return 6 * tile_bytes; }

 private:
  struct Level {
    std::unique_ptr<ColourCache> cache;
    std::atomic<const ColourCache*> ready{nullptr};  ///< the same, for whoever has no lock
  };
  struct Levels {
    Hash128 key;
    std::vector<Level> made;  ///< from level 1 on; never grows
  };
  std::unique_ptr<ColourCache> make(const ColourCache& before, const Hash128& key,
                                    std::uint32_t level);

  job::JobContext& job_;
  std::map<const ColourCache*, Levels> images_;
};

}  // namespace pounce::flow
