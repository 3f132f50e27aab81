// SPDX-License-Identifier: Apache-2.0
//
// Blocks in tiles: the one writer and the one reader of packs whose blocks are found by place in
// space.
//
// A pack of blocks is the same file whatever a block is: blocks, after each tile its page of the
// index, a directory at the end. What differs is a Codec: a struct of types (Entry, Tile, Index,
// Directory, Facts, Block), of bounds (kMostEntryBytes, kMostBlockBytes, most_directory_bytes) and
// of functions between them and their bytes, each of which throws Error(damaged_store) for bytes
// that its writer does not make. Layout: docs/tile-format.md.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/bounds.h"
#include "core/bytes.h"
#include "pounce/error.h"
#include "store/pack/codec.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// What every directory says of its tiles. A Codec's Index adds its own maxima.
template <class Tile>
struct TileIndex {
  std::vector<Tile> tiles;
  std::uint32_t most_blocks = 0;          ///< of any tile
  std::uint32_t largest_chunk_bytes = 0;  ///< raw, of a block
  Box3f box;                              ///< of everything
};

/// Writes blocks in tile order. Not thread-safe.
template <class Codec>
class BlockStoreWriter {
 public:
  using Entry = typename Codec::Entry;

  explicit BlockStoreWriter(std::unique_ptr<PackWriter> pack) : pack_(std::move(pack)) {}

  /// One encoded block and its entry (without chunk) belongs to the tile that end_tile() closes.
  void add_block(Entry entry, std::span<const std::byte> stored, std::uint32_t raw_bytes) {
    entry.chunk = pack_->append(ChunkKind::block, stored, raw_bytes);
    index_.largest_chunk_bytes = std::max(index_.largest_chunk_bytes, raw_bytes);
    Codec::count(entry, index_);
    tile_.push_back(entry);
  }

  std::span<const Entry> open_tile() const { return tile_; }  ///< blocks of the tile that is open

  /// Does nothing if no block was added since the last one.
  void end_tile(Compressor& compressor) {
    if (tile_.empty()) return;
    std::vector<std::byte> raw;
    ByteWriter out(raw);
    auto tile = Codec::tile_of(tile_.front());
    for (const Entry& entry : tile_) {
      Codec::put(entry, out);
      tile.box.extend(Codec::box_of(entry));
    }
    tile.index_page = append_payload(*pack_, ChunkKind::index_page, raw, compressor);
    tile.blocks = static_cast<std::uint32_t>(tile_.size());
    index_.most_blocks = std::max(index_.most_blocks, tile.blocks);
    index_.box.extend(tile.box);
    index_.tiles.push_back(tile);
    tile_.clear();
  }

  /// Writes the directory, whose Index is filled in here, and the footer.
  std::unique_ptr<PackWriter> finish(typename Codec::Directory directory, Compressor& compressor) {
    static_cast<typename Codec::Index&>(directory) = std::move(index_);
    std::vector<std::byte> raw;
    ByteWriter out(raw);
    Codec::put(directory, out);
    pack_->finish(append_payload(*pack_, ChunkKind::directory, raw, compressor));
    return std::move(pack_);
  }

 private:
  std::unique_ptr<PackWriter> pack_;
  std::vector<Entry> tile_;
  typename Codec::Index index_;
};

/// Reads a pack of blocks. Whatever the pack holds, what comes out of here agrees with `facts` and
/// with itself, or Error(damaged_store) is thrown. Const members are thread-safe.
template <class Codec>
class BlockStore {
 public:
  using Entry = typename Codec::Entry;
  using Facts = typename Codec::Facts;

  BlockStore(std::unique_ptr<PackReader> pack, Facts facts, Compressor& compressor)
      : pack_(std::move(pack)), facts_(std::move(facts)) {
    const auto raw =
        read_payload(*pack_, pack_->directory(), ChunkKind::directory,
                     Codec::most_directory_bytes(facts_, pack_->size_bytes()), compressor);
    ByteReader in(raw, pack_->name() + ": directory");
    directory_ = Codec::get_directory(in);
    Codec::check(directory_, facts_, pack_->name() + ": directory");
  }

  const typename Codec::Directory& directory() const { return directory_; }
  const Facts& facts() const { return facts_; }

  /// Blocks of one tile, at least one.
  std::vector<Entry> read_index(std::uint32_t tile, Compressor& compressor) const {
    const auto& where = directory_.tiles[tile];
    const auto raw = read_payload(*pack_, where.index_page, ChunkKind::index_page,
                                  where.blocks * Codec::kMostEntryBytes, compressor);
    ByteReader in(raw, pack_->name() + ": index page");
    if (where.blocks * Codec::kLeastEntryBytes > raw.size()) in.fail("is too small for its blocks");
    std::vector<Entry> entries(where.blocks);
    for (Entry& entry : entries) entry = Codec::get_entry(in);
    if (in.left() != 0) in.fail("has bytes left over");
    Codec::check(entries, where, directory_, facts_, pack_->name() + ": index page");
    return entries;
  }

  typename Codec::Block read_block(const Entry& entry, Compressor& compressor) const {
    const auto raw =
        read_payload(*pack_, entry.chunk, ChunkKind::block, Codec::kMostBlockBytes, compressor);
    auto block = Codec::decode(raw, pack_->name() + ": block");
    Codec::check(block, entry, directory_, facts_, pack_->name() + ": block");
    return block;
  }

  const PackReader& pack() const { return *pack_; }
  /// Throws Error(damaged_store): "<pack>: <why>".
  [[noreturn]] void damaged(const char* why) const {
    throw Error(ErrorKind::damaged_store, pack_->name() + ": " + why);
  }
  /// Memory that stays in use while the store is open.
  std::uint64_t size_bytes() const { return Codec::size_bytes(directory_, facts_); }

 private:
  std::unique_ptr<PackReader> pack_;
  Facts facts_;
  typename Codec::Directory directory_;
};

}  // namespace pounce::store
