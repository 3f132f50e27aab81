// SPDX-License-Identifier: Apache-2.0
//
// The hits of one page of a target on one source: what a search found, block by block of the image.
// Layout: docs/tile-format-hits.md.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "pounce/options.h"
#include "store/pack/codec.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// Blocks of 64x64 texels of an image, row by row.
struct HitGrid {
  std::uint32_t across = 0, down = 0;
  explicit HitGrid(ImageSize image);
  std::size_t blocks() const { return std::size_t{across} * down; }
  /// Memory of the places of all blocks, while a store is open or being written.
  std::uint64_t index_bytes() const { return blocks() * sizeof(ChunkRef); }
};

/// Writes the blocks of a page, in any order. Not thread-safe.
class HitStoreWriter {
 public:
  HitStoreWriter(std::unique_ptr<PackWriter> pack, HitGrid grid);
  /// Of a block that hit something, once. x and y count blocks.
  void add(std::uint32_t x, std::uint32_t y, std::span<const std::byte> stored,
           std::uint32_t raw_bytes);
  std::unique_ptr<PackWriter> finish(Compressor& compressor);
  const PackWriter& pack() const { return *pack_; }

 private:
  std::unique_ptr<PackWriter> pack_;
  HitGrid grid_;
  std::vector<ChunkRef> blocks_;
};

/// Reads them. Const members are thread-safe.
class HitStore {
 public:
  /// What the job knows of the hits.
  struct Facts {
    ImageSize image;  ///< of the target's page
    std::size_t source_pages = 0;
    std::uint32_t most_bytes = 0;  ///< of an encoded block
  };
  /// Throws Error(damaged_store) for the hits of another image.
  HitStore(std::unique_ptr<PackReader> pack, Facts facts, Compressor& compressor);
  /// The encoded hits of a block; empty: it has none.
  UnsetBytes read(std::uint32_t x, std::uint32_t y, Compressor& compressor) const;
  const HitGrid& grid() const { return grid_; }
  const Facts& facts() const { return facts_; }
  const PackReader& pack() const { return *pack_; }

 private:
  std::unique_ptr<PackReader> pack_;
  Facts facts_;
  HitGrid grid_;
  std::vector<ChunkRef> blocks_;
};

}  // namespace pounce::store
