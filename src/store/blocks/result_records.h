// SPDX-License-Identifier: Apache-2.0
//
// What stands in a pack of results beside its blocks, so that a later run can go on with it:
// records of what is made, and encoded rows. Layouts: docs/tile-format-colours.md.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/file.h"
#include "core/hash.h"
#include "mesh/lattice.h"
#include "pounce/report.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// Counts of results: integers, so that any partition of a page has the same sums.
struct ResultCounts {
  std::vector<std::uint64_t> covered;  ///< [channel] texels that found something
  std::vector<std::uint64_t> clipped;  ///< [channel] samples beyond what the output's depth holds
  DistanceCounts distances{};          ///< of all texels that found something
  std::uint64_t distance_steps = 0;    ///< of a mesh, their sum: projection::distance_steps()

  void add(const ResultCounts& more);
};

/// Blocks of a page in rows.
struct ResultGrid {
  std::uint32_t across = 0, down = 0;
  std::size_t channels = 0;
  ResultGrid(const mesh::Lattice& page, std::size_t of_channels);
  std::size_t blocks() const { return std::size_t{across} * down; }
  std::size_t slot(std::int32_t x, std::int32_t y) const {
    return static_cast<std::size_t>(y) * across + static_cast<std::size_t>(x);
  }
};

/// The blocks of a piece, those that cover nothing too. Their chunks precede the record.
struct ResultRecord {
  struct Block {
    std::int32_t x = 0, y = 0;
    std::uint32_t texels = 0;     ///< that the target covers
    std::vector<bool> has_chunk;  ///< [channel]
  };
  std::vector<Block> blocks;
  ResultCounts counts;
  std::uint64_t page_texels = 0;  ///< that the target covers in the whole page
  std::uint64_t worked_ms = 0;    ///< by all runs so far

  std::uint64_t texels() const;
  std::size_t chunks() const;
};
void encode(const ResultRecord& record, std::vector<std::byte>& bytes);
/// Nothing where it states what cannot be: a block beyond the page or twice, more than there is.
std::optional<ResultRecord> decode_record(std::span<const std::byte> bytes, const ResultGrid& grid);

/// Which rows were encoded: a block of an image of the step, and the hash of what was encoded.
struct EncodedRows {
  std::uint32_t image = 0, block = 0;
  Hash128 rows;
};
/// That stands before the bytes that the rows became.
inline constexpr std::size_t kEncodedRowsBytes = 24;
void encode(const EncodedRows& rows, std::vector<std::byte>& bytes);
std::optional<EncodedRows> decode_encoded_rows(std::span<const std::byte> bytes);

/// How much of a page an unfinished pack holds.
struct HalfDone {
  std::uint64_t blocks = 0, texels = 0, of_texels = 0;
  double worked_s = 0;
};
/// Nothing where it holds nothing that can be gone on with.
std::optional<HalfDone> half_done(const ReadFile& pack, const Hash128& key, const ResultGrid& grid);

}  // namespace pounce::store
