// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "store/blocks/geometry_block.h"
#include "store/blocks/geometry_check.h"
#include "store/pack/codec.h"
#include "store/pack/pack.h"

namespace pounce::store {

inline constexpr std::size_t kMostBoxesPerBlock = 8;

/// What a join needs to know of a block before it is read.
struct BlockEntry {
  std::uint32_t page = 0;
  std::int32_t x = 0, y = 0;
  std::uint32_t triangles = 0;
  std::uint32_t patches = 0;  ///< source: patches it decodes to
  std::uint32_t texels = 0;   ///< target: covered texel centres
  ChunkRef chunk;
  std::uint32_t box_count = 0;
  std::array<Box3f, kMostBoxesPerBlock> boxes;  ///< together they hold the block's surface

  Box3f box() const;
};

/// A spatial tile: blocks that were stored together, and its page of the index.
struct TileEntry {
  Box3f box;
  ChunkRef index_page;
  std::uint32_t blocks = 0;
};

/// What a geometry pack says of itself: the chunk a reader starts from. Small; always in memory.
struct GeometryDirectory {
  std::vector<mesh::Lattice> pages;
  std::vector<TileEntry> tiles;
  std::uint64_t texels =
      0;  ///< covered texel centres: the Gaussians of a source, the map of a target
  std::uint64_t overlapping = 0;  ///< target: texels that more than one triangle claimed
  std::uint64_t slivers = 0;      ///< source: triangles that cover no texel centre
  std::uint64_t degenerate = 0;   ///< triangles without area in space, left out
  std::uint32_t most_triangles = 0, most_patches = 0;  ///< of any block
  std::uint32_t most_blocks = 0;                       ///< of any tile
  std::uint32_t largest_chunk_bytes = 0;               ///< raw
  Box3f box;
  std::vector<std::uint64_t> page_texels;  ///< covered texel centres per page
};

/// Writes blocks in tile order.
class GeometryStoreWriter {
 public:
  explicit GeometryStoreWriter(std::unique_ptr<PackWriter> pack);
  /// One encoded block and its entry (without chunk) belongs to the tile that end_tile() closes.
  void add_block(BlockEntry entry, std::span<const std::byte> stored, std::uint32_t raw_bytes);
  void end_tile(Compressor& compressor);
  /// Writes the directory (its tiles and maxima are filled in here) and the footer.
  std::unique_ptr<PackWriter> finish(GeometryDirectory directory, Compressor& compressor);

 private:
  std::unique_ptr<PackWriter> pack_;
  std::vector<BlockEntry> tile_;
  GeometryDirectory built_;
};

/// Reads a geometry pack. Whatever the pack holds, what comes out of here agrees with `facts` and
/// with itself, or Error(damaged_store) is thrown. Const members are thread-safe.
class GeometryStore {
 public:
  GeometryStore(std::unique_ptr<PackReader> pack, GeometryFacts facts, Compressor& compressor);
  const GeometryDirectory& directory() const { return directory_; }
  const GeometryFacts& facts() const { return facts_; }
  /// Blocks of one page, at least one.
  std::vector<BlockEntry> read_index(std::uint32_t tile, Compressor& compressor) const;
  GeometryBlock read_block(const BlockEntry& entry, Compressor& compressor) const;
  const PackReader& pack() const { return *pack_; }
  /// Throws Error(damaged_store): "<pack>: <why>".
  [[noreturn]] void damaged(const char* why) const;
  /// Memory that stays in use while the store is open.
  std::uint64_t size_bytes() const;

 private:
  std::unique_ptr<PackReader> pack_;
  GeometryFacts facts_;
  GeometryDirectory directory_;
};

/// Groups triangles' boxes into at most kMostBoxesPerBlock tight ones. Reorders `boxes`.
void cluster_boxes(std::vector<Box3f>& boxes, BlockEntry& entry);

}  // namespace pounce::store
