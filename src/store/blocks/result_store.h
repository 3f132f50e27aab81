// SPDX-License-Identifier: Apache-2.0
//
// The results of one page of a target, all of them, for a later job: blocks of texels as an image
// holds them, and what was counted. Layout: docs/tile-format-colours.md.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "store/blocks/result_records.h"
#include "store/pack/codec.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// Writes the blocks of a page, in any order. Not thread-safe.
class ResultStoreWriter {
 public:
  ResultStoreWriter(std::unique_ptr<PackWriter> pack, const ResultGrid& grid);
  /// Of a block that covers something, once. x and y count blocks.
  void add(std::size_t channel, std::int32_t x, std::int32_t y, std::span<const std::byte> stored,
           std::uint32_t raw_bytes);
  /// `counts`: of all blocks.
  std::unique_ptr<PackWriter> finish(const ResultCounts& counts, Compressor& compressor);
  const PackWriter& pack() const { return *pack_; }
  /// Memory of the places of all blocks.
  static std::uint64_t index_bytes(const ResultGrid& grid) {
    return grid.blocks() * grid.channels * sizeof(ChunkRef);
  }

 private:
  std::unique_ptr<PackWriter> pack_;
  ResultGrid grid_;
  std::vector<std::vector<ChunkRef>> blocks_;
};

/// Opens them. The blocks themselves are read like those of a job's own results.
struct ResultStore {
  /// What the job knows of the results.
  struct Facts {
    ResultGrid grid;
    std::vector<std::uint32_t> block_bytes;  ///< [channel] of each block, before compression
    std::uint64_t texels = 0;                ///< that the target covers in the page
  };
  std::unique_ptr<PackReader> pack;
  ResultCounts counts;
  std::vector<std::vector<ChunkRef>> blocks;  ///< as in ResultIndex

  /// Throws Error(damaged_store) for what no such page can have: another grid, blocks of another
  /// size, more texels.
  static ResultStore open(std::unique_ptr<PackReader> pack, const Facts& facts,
                          Compressor& compressor);
};

}  // namespace pounce::store
