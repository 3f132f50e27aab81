// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "store/blocks/block_store.h"
#include "store/blocks/geometry_block.h"

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

struct GeometryIndex : TileIndex<TileEntry> {
  std::uint32_t most_triangles = 0, most_patches = 0;  ///< of any block
};

/// What a geometry pack says of itself: the chunk a reader starts from. Small; always in memory.
struct GeometryDirectory : GeometryIndex {
  std::vector<mesh::Lattice> pages;
  std::uint64_t texels =
      0;  ///< covered texel centres: the Gaussians of a source, the map of a target
  std::uint64_t overlapping = 0;           ///< target: texels that more than one triangle claimed
  std::uint64_t slivers = 0;               ///< source: triangles that cover no texel centre
  std::uint64_t degenerate = 0;            ///< triangles without area in space, left out
  std::uint64_t coincident = 0;            ///< source: mesh::count_coincident(); 0 where exact
  std::vector<std::uint64_t> page_texels;  ///< covered texel centres per page
};

/// What a job knows of a geometry pack before it has seen it.
struct GeometryFacts {
  bool is_target = false;
  std::vector<mesh::Lattice> pages;
  std::uint64_t triangles = 0;    ///< of the mesh
  std::uint64_t most_blocks = 0;  ///< that it may have
  bool has_colours = false;       ///< of vertices
};

/// Triangles of a mesh, or texels of a dense target: see BlockStore.
struct GeometryCodec {
  using Entry = BlockEntry;
  using Tile = TileEntry;
  using Index = GeometryIndex;
  using Directory = GeometryDirectory;
  using Facts = GeometryFacts;
  using Block = GeometryBlock;
  static constexpr std::size_t kLeastEntryBytes = 44;
  static constexpr std::size_t kMostEntryBytes = kLeastEntryBytes + 24 * kMostBoxesPerBlock;
  static constexpr std::size_t kMostBlockBytes = kLargestGeometryBytes;
  static std::uint64_t most_directory_bytes(const Facts& facts, std::uint64_t pack_bytes);

  static void count(const Entry& entry, Index& index);
  static Tile tile_of(const Entry&) { return {}; }
  static Box3f box_of(const Entry& entry) { return entry.box(); }
  static void put(const Entry& entry, ByteWriter& out);
  static Entry get_entry(ByteReader& in);
  static void put(const Directory& directory, ByteWriter& out);
  static Directory get_directory(ByteReader& in);
  static Block decode(std::span<const std::byte> raw, const std::string& name) {
    return decode_geometry(raw, name);
  }
  static std::uint64_t size_bytes(const Directory& directory, const Facts& facts);

  static void check(const Directory& directory, const Facts& facts, const std::string& name);
  static void check(const std::vector<Entry>& entries, const Tile& tile, const Directory& directory,
                    const Facts& facts, const std::string& name);
  static void check(const Block& block, const Entry& entry, const Directory& directory,
                    const Facts& facts, const std::string& name);
};
using GeometryStoreWriter = BlockStoreWriter<GeometryCodec>;
using GeometryStore = BlockStore<GeometryCodec>;

/// Groups triangles' boxes into at most kMostBoxesPerBlock tight ones. Reorders `boxes`.
void cluster_boxes(std::vector<Box3f>& boxes, BlockEntry& entry);

}  // namespace pounce::store
