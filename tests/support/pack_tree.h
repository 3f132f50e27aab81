// SPDX-License-Identifier: Apache-2.0
//
// A pack taken apart into payloads and put together again with right checksums and places, whatever
// its payloads say by then: what somebody who means harm would write.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/file.h"
#include "store/blocks/colour_store.h"
#include "store/pack/codec.h"
#include "store/pack/pack.h"
#include "store/pack/pack_layout.h"
#include "support/bytes.h"

namespace pounce::test {

struct PackTree {
  using Bytes = std::vector<std::byte>;
  struct Tile {
    Bytes page;                   ///< of the index
    std::vector<Bytes> blocks;    ///< payloads, in the page's order
    std::vector<std::size_t> at;  ///< where the page holds each block's chunk
  };
  store::PackKind kind{};
  Hash128 key;
  Bytes directory;
  std::vector<Tile> tiles;
  std::vector<std::size_t> at;  ///< where the directory holds each page's chunk
  /// Of hits and results, which have no tiles: payloads, and where the directory holds each one's
  /// chunk.
  std::vector<Bytes> blocks;
  std::vector<std::size_t> block_at;

  static std::uint32_t u32(const Bytes& raw, std::size_t at) {
    return store::get_u32(raw.data() + at);
  }

  explicit PackTree(const std::string& path) {
    auto file = posix_file_system().open(path);
    const store::PackInfo info = store::read_pack_info(*file, path);
    kind = info.kind;
    key = info.key;
    const store::PackReader pack(std::move(file), path, kind, key);
    store::Compressor compressor;
    const auto read = [&](const store::ChunkRef& ref, store::ChunkKind what) {
      return bytes_of(store::read_payload(pack, ref, what, store::kLargestChunkBytes, compressor));
    };
    directory = read(pack.directory(), store::ChunkKind::directory);
    if (kind == store::PackKind::hits) {
      find_places(8, directory.size());
    } else if (kind == store::PackKind::results) {
      const std::size_t places =
          std::size_t{u32(directory, 0)} * u32(directory, 4) * u32(directory, 8);
      find_places(12, 12 + 16 * places);
    } else {
      find_tiles();
    }
    for (const std::size_t place : block_at)
      blocks.push_back(read(chunk(directory, place), store::ChunkKind::block));
    for (const std::size_t place : at) {
      Tile tile;
      tile.page = read(chunk(directory, place), store::ChunkKind::index_page);
      find_blocks(tile);
      for (const std::size_t block : tile.at)
        tile.blocks.push_back(read(chunk(tile.page, block), store::ChunkKind::block));
      tiles.push_back(std::move(tile));
    }
  }

  /// Called with each page (its tile's number) and the directory (-1) when all places are right.
  using Harm = std::function<void(int tile, Bytes& raw)>;

  void write(const std::string& path, const Harm& harm) const {
    PackTree copy = *this;
    posix_file_system().remove(path);
    store::PackWriter pack(posix_file_system().create(path), kind, key);
    store::Compressor compressor;
    for (std::size_t t = 0; t < copy.tiles.size(); ++t) {
      Tile& tile = copy.tiles[t];
      for (std::size_t b = 0; b < tile.blocks.size(); ++b) {
        put(tile.page, tile.at[b],
            store::append_payload(pack, store::ChunkKind::block, tile.blocks[b], compressor));
      }
      harm(static_cast<int>(t), tile.page);
      put(copy.directory, copy.at[t],
          store::append_payload(pack, store::ChunkKind::index_page, tile.page, compressor));
    }
    for (std::size_t b = 0; b < copy.blocks.size(); ++b) {
      put(copy.directory, copy.block_at[b],
          store::append_payload(pack, store::ChunkKind::block, copy.blocks[b], compressor));
    }
    harm(-1, copy.directory);
    pack.finish(
        store::append_payload(pack, store::ChunkKind::directory, copy.directory, compressor));
    pack.file().sync();
  }
  void write(const std::string& path) const {
    write(path, [](int, Bytes&) {});
  }

 private:
  static store::ChunkRef chunk(const Bytes& raw, std::size_t at) {
    return {store::get_u64(raw.data() + at), u32(raw, at + 8), u32(raw, at + 12)};
  }
  static void put(Bytes& raw, std::size_t at, const store::ChunkRef& chunk) {
    store::put_u64(raw.data() + at, chunk.offset);
    store::put_u32(raw.data() + at + 8, chunk.stored_bytes);
    store::put_u32(raw.data() + at + 12, chunk.raw_bytes);
  }

  void find_tiles() {
    const bool geometry = kind == store::PackKind::geometry;
    const std::size_t first = geometry ? 88 + 68 * std::size_t{u32(directory, 0)} + 24
                              : kind == store::PackKind::colour ? 25
                                                                : 180 + 24;
    const std::size_t step = geometry ? 44 : kind == store::PackKind::colour ? 16 : 48;
    for (std::size_t place = first; place + 16 <= directory.size(); place += step)
      at.push_back(place);
  }
  void find_places(std::size_t first, std::size_t end) {
    for (std::size_t place = first; place + 16 <= end; place += 16) {
      if (chunk(directory, place).raw_bytes > 0) block_at.push_back(place);
    }
  }
  void find_blocks(Tile& tile) const {
    std::size_t place = 0;
    while (place < tile.page.size()) {
      if (kind == store::PackKind::geometry) {
        tile.at.push_back(place + 24);
        place += 44 + 24 * std::size_t{u32(tile.page, place + 40)};
      } else {
        const bool colour = kind == store::PackKind::colour;
        const std::size_t where = colour ? place : place + 32;
        if (!store::is_left_out(chunk(tile.page, where))) tile.at.push_back(where);
        place += colour ? 16 : 48;
      }
    }
  }
};

}  // namespace pounce::test
