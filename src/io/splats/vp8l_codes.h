// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "io/splats/vp8l_bits.h"

namespace pounce::io {

/// A prefix code. An entry of its table is symbol << 4 | bits of the code; codes of more than
/// kPrimaryBits bits are found through an entry that says where a second table begins and how many
/// bits lead there and through it.
struct PrefixCode {
  static constexpr std::uint32_t kPrimaryBits = 9;

  const std::uint16_t* table = nullptr;
  std::uint32_t mask = 0;  ///< of the bits that choose an entry

  /// Takes up to 15 bits, which must be sure.
  std::uint32_t read(BitState& state) const {
    std::uint32_t entry = table[state.bits & mask];
    if ((entry & 15) > kPrimaryBits) [[unlikely]] {
      const std::uint32_t second = (1U << ((entry & 15) - kPrimaryBits)) - 1;
      entry = table[(entry >> 4) + ((state.bits >> kPrimaryBits) & second)];
    }
    state.skip(entry & 15);
    return entry >> 4;
  }
};

/// The codes of a region of an image.
struct PrefixGroup {
  PrefixCode green, red, blue, alpha, distance;
};

/// The tables of many codes, in blocks that never move.
class PrefixTables {
 public:
  /// Of green: its values, lengths of copies, places of the largest colour cache.
  static constexpr std::uint32_t kMostSymbols = 256 + 24 + 2048;
  /// Canonical codes come sorted by length: but for one second table for each length there are no
  /// more entries in them than symbols.
  static constexpr std::size_t kMostEntries =
      (1 << PrefixCode::kPrimaryBits) + kMostSymbols +
      (15 - PrefixCode::kPrimaryBits) * (1 << (15 - PrefixCode::kPrimaryBits));

  PrefixCode add(std::span<const std::uint16_t> table);
  std::uint64_t bytes() const { return blocks_.size() * kBlockEntries * sizeof(std::uint16_t); }

 private:
  static constexpr std::size_t kBlockEntries = 32 << 10;

  std::vector<std::unique_ptr<std::uint16_t[]>> blocks_;
  std::size_t used_ = kBlockEntries;  ///< entries of the last block
};

/// Reads the lengths of the code of an alphabet of `symbols` symbols and adds it to `tables`, if
/// they are given. Throws Error(input) where they make no code.
PrefixCode read_prefix_code(BitSource& source, std::uint32_t symbols, PrefixTables* tables);

}  // namespace pounce::io
