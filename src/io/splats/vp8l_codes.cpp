// SPDX-License-Identifier: Apache-2.0
#include "io/splats/vp8l_codes.h"

#include <algorithm>

#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint32_t kMostBits = 15;
/// The order in which the lengths of the code of the lengths are stored: rare ones last.
constexpr std::array<std::uint8_t, 19> kLengthOrder{17, 18, 0, 1,  2,  3,  4,  5,  16, 6,
                                                    7,  8,  9, 10, 11, 12, 13, 14, 15};

std::uint32_t reversed(std::uint32_t code, std::uint32_t bits) {
  std::uint32_t result = 0;
  for (std::uint32_t i = 0; i < bits; ++i) result |= ((code >> i) & 1) << (bits - 1 - i);
  return result;
}

std::uint16_t entry_of(std::size_t value, std::uint32_t bits) {
  return static_cast<std::uint16_t>(value << 4 | bits);
}

/// Symbols by the length of their code, then by number, and their codes with the first bit lowest.
struct Canonical {
  std::uint32_t used = 0;
  std::uint32_t longest = 0;
  std::array<std::uint16_t, PrefixTables::kMostSymbols> symbols;
  std::array<std::uint16_t, PrefixTables::kMostSymbols> codes;

  /// False if the lengths make no code.
  bool assign(std::span<const std::uint8_t> lengths) {
    std::array<std::uint32_t, kMostBits + 1> count{}, place{}, next{};
    for (const std::uint8_t length : lengths) ++count[length];
    count[0] = 0;  // those symbols have no code
    std::uint32_t code = 0;
    for (std::uint32_t bits = 1; bits <= kMostBits; ++bits) {
      place[bits] = used;
      used += count[bits];
      code = (code + count[bits - 1]) << 1;
      next[bits] = code;
      if (count[bits] > 0) longest = bits;
      if (code + count[bits] > 1U << bits) return false;
    }
    if (used == 0) return false;
    if (used > 1 && next[kMostBits] + count[kMostBits] != 1U << kMostBits) return false;
    for (std::size_t symbol = 0; symbol < lengths.size(); ++symbol) {
      const std::uint32_t bits = lengths[symbol];
      if (bits == 0) continue;
      symbols[place[bits]] = static_cast<std::uint16_t>(symbol);
      codes[place[bits]++] = static_cast<std::uint16_t>(reversed(next[bits]++, bits));
    }
    return true;
  }
};

using Table = std::array<std::uint16_t, PrefixTables::kMostEntries>;

/// What the codes of more than kPrimaryBits bits that begin with the same bits need.
struct Second {
  std::uint16_t begin = 0;
  std::uint8_t longest = 0;  ///< of their codes; 0 = there are none
};

/// The table of the canonical code with these lengths, 0..15, of its symbols; empty if they are too
/// many or too few for a code. A single symbol takes no bits at all.
std::span<const std::uint16_t> make_table(std::span<const std::uint8_t> lengths, Table& table) {
  constexpr std::uint32_t kPrimary = PrefixCode::kPrimaryBits;
  Canonical canonical;
  if (!canonical.assign(lengths)) return {};
  if (canonical.used == 1) {
    table[0] = entry_of(canonical.symbols[0], 0);
    return std::span(table).first(1);
  }
  const std::size_t slots = std::size_t{1} << std::min(canonical.longest, kPrimary);
  std::array<Second, 1 << kPrimary> seconds{};
  for (std::uint32_t i = 0; i < canonical.used; ++i) {
    const std::uint8_t bits = lengths[canonical.symbols[i]];
    if (bits > kPrimary)
      seconds[canonical.codes[i] & (slots - 1)].longest = bits;  // they come sorted
  }
  std::size_t entries = slots;
  for (std::size_t slot = 0; slot < slots; ++slot) {
    Second& second = seconds[slot];
    if (second.longest == 0) continue;
    second.begin = static_cast<std::uint16_t>(entries);
    table[slot] = entry_of(entries, second.longest);
    entries += std::size_t{1} << (second.longest - kPrimary);
  }
  for (std::uint32_t i = 0; i < canonical.used; ++i) {
    const std::uint32_t code = canonical.codes[i];
    const std::uint32_t bits = lengths[canonical.symbols[i]];
    const bool is_short = bits <= kPrimary;
    const Second& second = seconds[code & (slots - 1)];
    const std::size_t begin = is_short ? 0 : second.begin;
    const std::size_t size = is_short ? slots : std::size_t{1} << (second.longest - kPrimary);
    const std::uint32_t skipped = is_short ? 0 : kPrimary;
    for (std::size_t at = code >> skipped; at < size; at += std::size_t{1} << (bits - skipped))
      table[begin + at] = entry_of(canonical.symbols[i], bits);
  }
  return std::span(table).first(entries);
}

PrefixCode code_of(std::span<const std::uint16_t> table) {
  if (table.empty()) return {};
  const std::size_t primary = std::size_t{1} << PrefixCode::kPrimaryBits;
  return {table.data(), static_cast<std::uint32_t>(std::min(table.size(), primary) - 1)};
}

using Lengths = std::array<std::uint8_t, PrefixTables::kMostSymbols>;

/// One or two symbols, written as they are.
void read_simple(BitSource& source, std::uint32_t symbols, Lengths& lengths) {
  const std::uint32_t count = source.read(1) + 1;
  const std::uint32_t first_bits = source.read(1) == 0 ? 1 : 8;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t symbol = source.read(i == 0 ? first_bits : 8);
    if (symbol >= symbols) source.fail("a prefix code has a symbol that its alphabet has not");
    lengths[symbol] = 1;
  }
}

/// Lengths that have a prefix code of their own.
void read_normal(BitSource& source, std::uint32_t symbols, Lengths& lengths) {
  std::array<std::uint8_t, 19> length_lengths{};
  const std::uint32_t count = source.read(4) + 4;
  for (std::uint32_t i = 0; i < count; ++i)
    length_lengths[kLengthOrder[i]] = static_cast<std::uint8_t>(source.read(3));
  Table table;
  const PrefixCode code = code_of(make_table(length_lengths, table));
  if (code.table == nullptr) source.fail("the lengths of a prefix code have no complete code");
  std::uint32_t stored = symbols;
  if (source.read(1) == 1) {
    const std::uint32_t bits = 2 + 2 * source.read(3);
    stored = 2 + source.read(bits);
    if (stored > symbols) source.fail("a prefix code has more lengths than symbols");
  }
  std::uint8_t last = 8;  // what is repeated if nothing was there before
  std::uint32_t symbol = 0;
  for (; stored > 0 && symbol < symbols; --stored) {
    const std::uint32_t length = code.read(source.sure());
    if (length <= kMostBits) {
      lengths[symbol++] = static_cast<std::uint8_t>(length);
      if (length != 0) last = static_cast<std::uint8_t>(length);
      continue;
    }
    const std::uint32_t times = length == 16   ? 3 + source.read(2)
                                : length == 17 ? 3 + source.read(3)
                                               : 11 + source.read(7);
    if (times > symbols - symbol) source.fail("a prefix code has more lengths than symbols");
    std::fill_n(&lengths[symbol], times, length == 16 ? last : std::uint8_t{0});
    symbol += times;
  }
}

}  // namespace

PrefixCode PrefixTables::add(std::span<const std::uint16_t> table) {
  if (used_ + table.size() > kBlockEntries) {
    blocks_.push_back(std::make_unique<std::uint16_t[]>(kBlockEntries));
    used_ = 0;
  }
  const std::span copy(&blocks_.back()[used_], table.size());
  std::copy(table.begin(), table.end(), copy.begin());
  used_ += table.size();
  return code_of(copy);
}

PrefixCode read_prefix_code(BitSource& source, std::uint32_t symbols, PrefixTables* tables) {
  Lengths lengths;
  std::fill_n(lengths.begin(), symbols, std::uint8_t{0});
  if (source.read(1) == 1) {
    read_simple(source, symbols, lengths);
  } else {
    read_normal(source, symbols, lengths);
  }
  source.check();
  Table storage;
  const auto table = make_table(std::span(lengths).first(symbols), storage);
  if (table.empty()) source.fail("the lengths of a prefix code make no complete code");
  return tables != nullptr ? tables->add(table) : PrefixCode{};
}

}  // namespace pounce::io
