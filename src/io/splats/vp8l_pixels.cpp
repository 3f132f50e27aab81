// SPDX-License-Identifier: Apache-2.0
//
// The inner half of lossless WebP (RFC 9649): from the bits of a stream to pixels as they are
// stored, before transforms are undone. Three layers, each with what protects it:
//
//   BitSource      64 KiB of the stream. The decoding loop keeps its state in registers and looks
//                  ahead of what is sure, so zeros lie behind the last byte; that more bits were
//                  taken than there are is found once per row.
//   PrefixCode     canonical codes as tables of 2^9 entries with second tables behind them. Lengths
//                  that make no complete code are refused: with them some bits would name no
//                  symbol.
//   Vp8lPixels     a pixel is one of: four symbols (green, red, blue, alpha); the length and
//                  distance of a copy of pixels before it; a place in a cache of colours met
//                  before. Copies reach back less than 2^20 pixels, so a ring of that many is all
//                  that is ever needed of the rows above. Each copy is checked against both ends of
//                  the image.
//
// An image may have any number of groups of codes, one per block of pixels. Their tables are the
// only memory that the file decides on: 32 MiB at the most, groups that no block names are parsed
// and not kept. Which block has which group is written to the scratch file.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "io/problems.h"
#include "io/splats/vp8l.h"

namespace pounce::io {
namespace {

constexpr std::size_t kPieceBytes = 64 << 10;
constexpr std::size_t kSafeBytes = 32;  // three refills take 21 bytes and look at 8
constexpr std::size_t kPadBytes = 64;   // zeros behind the last byte

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
    // Codes of one length are numbered on from where the shorter ones end; more than fit into the
    // length are refused as they are counted.
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
    // One symbol alone needs no bits; of several every sequence of bits must lead to one.
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
  // Most codes fit into the first table, and one look-up finds symbol and length. A longer code
  // finds there where the second table for its first bits is.
  const std::size_t slots = std::size_t{1} << std::min(canonical.longest, kPrimary);
  std::array<Second, 1 << kPrimary> seconds{};
  for (std::uint32_t i = 0; i < canonical.used; ++i) {
    const std::uint8_t bits = lengths[canonical.symbols[i]];
    if (bits > kPrimary)
      seconds[canonical.codes[i] & (slots - 1)].longest = bits;  // they come sorted
  }
  // Where the long codes that begin alike go: a second table behind the first for each beginning.
  std::size_t entries = slots;
  for (std::size_t slot = 0; slot < slots; ++slot) {
    Second& second = seconds[slot];
    if (second.longest == 0) continue;
    second.begin = static_cast<std::uint16_t>(entries);
    table[slot] = entry_of(entries, second.longest);
    entries += std::size_t{1} << (second.longest - kPrimary);
  }
  // A code fills every entry that ends with it, since the first bit is the lowest.
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
    if (symbol >= symbols) source.fail("a prefix code has a symbol outside of its alphabet");
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

constexpr std::uint32_t kLengths = 256;  // symbols of green from here are lengths of copies
constexpr std::uint32_t kCached = kLengths + 24;  // and from here places in the cache
constexpr std::uint32_t kDistances = 40;

/// The nearest pixels to the left and above have distance symbols of their own, nearest first:
/// columns to the left, rows up.
struct Near {
  std::int8_t left, up;
};
constexpr std::array<Near, 120> kNear{{
    {0, 1},  {1, 0},  {1, 1},  {-1, 1}, {0, 2},  {2, 0},  {1, 2},  {-1, 2}, {2, 1},  {-2, 1},
    {2, 2},  {-2, 2}, {0, 3},  {3, 0},  {1, 3},  {-1, 3}, {3, 1},  {-3, 1}, {2, 3},  {-2, 3},
    {3, 2},  {-3, 2}, {0, 4},  {4, 0},  {1, 4},  {-1, 4}, {4, 1},  {-4, 1}, {3, 3},  {-3, 3},
    {2, 4},  {-2, 4}, {4, 2},  {-4, 2}, {0, 5},  {3, 4},  {-3, 4}, {4, 3},  {-4, 3}, {5, 0},
    {1, 5},  {-1, 5}, {5, 1},  {-5, 1}, {2, 5},  {-2, 5}, {5, 2},  {-5, 2}, {4, 4},  {-4, 4},
    {3, 5},  {-3, 5}, {5, 3},  {-5, 3}, {0, 6},  {6, 0},  {1, 6},  {-1, 6}, {6, 1},  {-6, 1},
    {2, 6},  {-2, 6}, {6, 2},  {-6, 2}, {4, 5},  {-4, 5}, {5, 4},  {-5, 4}, {3, 6},  {-3, 6},
    {6, 3},  {-6, 3}, {0, 7},  {7, 0},  {1, 7},  {-1, 7}, {5, 5},  {-5, 5}, {7, 1},  {-7, 1},
    {4, 6},  {-4, 6}, {6, 4},  {-6, 4}, {2, 7},  {-2, 7}, {7, 2},  {-7, 2}, {3, 7},  {-3, 7},
    {7, 3},  {-7, 3}, {5, 6},  {-5, 6}, {6, 5},  {-6, 5}, {8, 0},  {4, 7},  {-4, 7}, {7, 4},
    {-7, 4}, {8, 1},  {8, 2},  {6, 6},  {-6, 6}, {8, 3},  {5, 7},  {-5, 7}, {7, 5},  {-7, 5},
    {8, 4},  {6, 7},  {-6, 7}, {7, 6},  {-7, 6}, {8, 5},  {7, 7},  {-7, 7}, {8, 6},  {8, 7},
}};

/// The number that a symbol and the bits after it stand for, from 1: lengths and distances.
std::uint32_t read_number(BitState& state, std::uint32_t symbol) {
  if (symbol < 4) return symbol + 1;
  const std::uint32_t bits = (symbol - 2) >> 1;
  return ((2 + (symbol & 1)) << bits) + state.take(bits) + 1;
}

/// How many pixels back in an image of this width.
std::uint64_t distance_of(std::uint32_t number, std::uint32_t width) {
  if (number > kNear.size()) return number - kNear.size();
  const Near near = kNear[number - 1];
  // To the right of the place above means less than a row; in a narrow image it would be this pixel
  // or a later one, for which the format says 1.
  const std::int64_t distance = std::int64_t{near.up} * width + near.left;
  return static_cast<std::uint64_t>(std::max<std::int64_t>(1, distance));
}

}  // namespace

BitSource::BitSource(const ReadFile& file, std::uint64_t at, std::uint64_t bytes, std::string name,
                     std::uint64_t origin)
    : file_(file), at_(at), bytes_(bytes), origin_(origin), name_(std::move(name)) {
  buffer_.resize(kPieceBytes + kSafeBytes + kPadBytes);
  state_.next = state_.safe = buffer_.data();
}

// Called when fewer than kSafeBytes are left. At the end of the stream zeros follow, so that no
// loop has to ask; taking them is found by check().
BitState BitSource::more(const BitState& state) {
  const std::size_t held = static_cast<std::size_t>(loaded_ - buffer_at_);
  const std::size_t used = static_cast<std::size_t>(state.next - buffer_.data());
  if (used > held) {  // among the zeros behind the end
    state_ = state;
    check();
  }
  const std::size_t left = held - used;  // no more than kSafeBytes
  // The unread rest moves to the front, so that a refill may look at eight bytes in a row.
  std::memmove(buffer_.data(), buffer_.data() + used, left);
  buffer_at_ += used;
  const std::size_t piece =
      static_cast<std::size_t>(std::min<std::uint64_t>(kPieceBytes, bytes_ - loaded_));
  file_.read(at_ + loaded_, std::span(buffer_).subspan(left, piece));
  loaded_ += piece;
  std::size_t end = left + piece;
  if (loaded_ == bytes_) {
    std::fill_n(buffer_.begin() + static_cast<std::ptrdiff_t>(end), kPadBytes, std::byte{0});
    end += kPadBytes;
  }
  BitState result = state;
  result.next = buffer_.data();
  result.safe = buffer_.data() + end - kSafeBytes;
  return result;
}

std::uint64_t BitSource::bits_taken() const {
  return 8 * (buffer_at_ + static_cast<std::uint64_t>(state_.next - buffer_.data())) - state_.count;
}

void BitSource::check() const {
  if (bits_taken() > 8 * bytes_) fail("it ends too early");
}

void BitSource::fail(const std::string& what) const {
  const std::uint64_t byte = at_ - origin_ + std::min(bits_taken() / 8, bytes_);
  refuse(name_, "its image is damaged at byte {}: {}; download it or export it again", byte, what);
}

// Blocks of 64 KiB: tables are small and many, and codes point into them.
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
  if (table.empty()) source.fail("the lengths of a prefix code do not form a complete code");
  return tables != nullptr ? tables->add(table) : PrefixCode{};
}

// A power of two, so that a mask finds the place of a pixel.
PixelRing::PixelRing(std::uint64_t pixels)
    : pixels_(std::bit_ceil(std::min(pixels, kMostPixels))) {}

// What comes before the pixels, in the order of the stream. Only the main image has groups of
// codes; those that steer it have one.
Vp8lPixels::Vp8lPixels(BitSource& source, std::uint32_t width, std::uint32_t height,
                       PixelRing& ring, WriteFile* scratch)
    : source_(source), width_(width), height_(height), ring_(ring) {
  if (source.read(1) == 1) {
    const std::uint32_t bits = source.read(4);
    if (bits < 1 || bits > 11) source.fail(fmt::format("a colour cache of 2^{} colours", bits));
    cache_.resize(std::size_t{1} << bits);
    cache_shift_ = 32 - bits;
  }
  if (scratch != nullptr && source.read(1) == 1) {
    read_group_image(*scratch);
  } else {
    group_is_used_ = {true};
  }
  read_groups();
}

// Which group of codes each block has: an image of its own, in red and green. Group numbers may
// have gaps, which are filled with groups that are parsed and thrown away.
void Vp8lPixels::read_group_image(WriteFile& scratch) {
  const std::uint32_t bits = source_.read(3) + 2;
  Vp8lBlocks<std::uint16_t>& blocks = group_of_block_.emplace(width_, bits, scratch);
  const std::uint32_t columns = blocks.size(width_), rows = blocks.size(height_);
  Vp8lPixels image(source_, columns, rows, ring_, nullptr);
  std::vector<std::uint32_t> pixels(columns);
  std::vector<std::uint16_t> groups(columns);
  for (std::uint32_t y = 0; y < rows; ++y) {
    image.read_row(pixels);
    for (std::uint32_t x = 0; x < columns; ++x) {
      groups[x] = static_cast<std::uint16_t>(pixels[x] >> 8);
      if (groups[x] >= group_is_used_.size()) group_is_used_.resize(groups[x] + std::size_t{1});
      group_is_used_[groups[x]] = true;
    }
    blocks.append(groups);
  }
}

void Vp8lPixels::read_groups() {
  const std::uint32_t greens = kCached + static_cast<std::uint32_t>(cache_.size());
  groups_.reserve(group_is_used_.size());
  for (const bool is_used : group_is_used_) {
    // A code that no block uses is read for its length in the stream alone.
    PrefixTables* const tables = is_used ? &tables_ : nullptr;
    PrefixGroup group;
    // In the order of the format: each code begins where the one before it ends.
    group.green = read_prefix_code(source_, greens, tables);
    group.red = read_prefix_code(source_, 256, tables);
    group.blue = read_prefix_code(source_, 256, tables);
    group.alpha = read_prefix_code(source_, 256, tables);
    group.distance = read_prefix_code(source_, kDistances, tables);
    groups_.push_back(group);
    if (memory_bytes() > kMostCodeBytes) {
      source_.fail(fmt::format("its {} groups of prefix codes need more than {} MiB",
                               group_is_used_.size(), kMostCodeBytes >> 20));
    }
  }
}

std::uint64_t Vp8lPixels::memory_bytes() const {
  return tables_.bytes() + groups_.capacity() * sizeof(PrefixGroup) + cache_.size() * 4;
}

template <bool kHasCache>
BitState Vp8lPixels::copy(BitState state, std::uint32_t length_symbol,
                          const PrefixCode& distances) {
  const std::uint64_t length = read_number(state, length_symbol);
  state.refill();
  const std::uint32_t number = read_number(state, distances.read(state));
  const std::uint64_t distance = distance_of(number, width_);
  const std::uint64_t pixels = std::uint64_t{width_} * height_;
  if (distance > position_ || length > pixels - position_) {
    source_.set(state);
    source_.fail(distance > position_ ? "a copy from before the first pixel"
                                      : "a copy beyond the last pixel");
  }
  std::uint32_t* const ring = ring_.data();
  const std::uint64_t mask = ring_.mask();
  const std::uint64_t to = position_ & mask, from = (position_ - distance) & mask;
  position_ += length;
  // Neither range may wrap round the ring, and the copy must not read what it writes: one from
  // nearer than its length repeats pixels.
  if (!kHasCache && distance >= length && to + length <= mask && from + length <= mask) {
    // The source may begin in what is about to be overwritten: the ring's oldest pixels.
    std::memmove(ring + to, ring + from, length * sizeof *ring);
    return state;
  }
  for (std::uint64_t i = 0; i < length; ++i) {
    const std::uint32_t pixel = ring[(from + i) & mask];
    ring[(to + i) & mask] = pixel;
    if constexpr (kHasCache) cache_[cache_slot(pixel)] = pixel;
  }
  return state;
}

template <bool kHasCache>
// The bits are in registers (state) and the position in a local: what the loop touches in memory
// are tables, the ring and the cache. A copy may run past the end of the row, into later ones.
void Vp8lPixels::decode_row() {
  const std::uint64_t begin = std::uint64_t{row_} * width_, end = begin + width_;
  std::span<const std::uint16_t> group_of_block;
  if (group_of_block_) group_of_block = group_of_block_->row(row_);
  std::uint32_t* const ring = ring_.data();
  const std::uint64_t mask = ring_.mask();
  BitState state = source_.state();
  while (position_ < end) {
    const PrefixGroup* group = groups_.data();
    std::uint64_t stop = end;
    if (group_of_block_) {
      const std::uint32_t bits = group_of_block_->bits();
      const std::uint64_t block = (position_ - begin) >> bits;
      group += group_of_block[block];
      // Up to the edge of the block the codes are the same: the inner loop asks for no block.
      stop = std::min(end, begin + ((block + 1) << bits));
    }
    std::uint64_t position = position_;
    while (position < stop) {
      if (state.next >= state.safe) [[unlikely]]
        state = source_.more(state);
      state.refill();
      const std::uint32_t green = group->green.read(state);
      std::uint32_t pixel;
      if (green < kLengths) {
        const std::uint32_t red = group->red.read(state);
        const std::uint32_t blue = group->blue.read(state);
        // At least 56 bits were sure, and three codes take 45 at most: the fourth may lack some.
        if (state.count < 15) [[unlikely]]
          state.refill();
        pixel = group->alpha.read(state) << 24 | red << 16 | green << 8 | blue;
      } else if (green < kCached) {
        position_ = position;
        state = copy<kHasCache>(state, green - kLengths, group->distance);
        position = position_;
        continue;
      } else {
        pixel = cache_[green - kCached];
      }
      ring[position++ & mask] = pixel;
      if constexpr (kHasCache) cache_[cache_slot(pixel)] = pixel;
    }
    position_ = position;
  }
  source_.set(state);
  source_.check();
}

void Vp8lPixels::read_row(std::span<std::uint32_t> out) {
  if (cache_.empty()) {
    decode_row<false>();
  } else {
    decode_row<true>();
  }
  const std::uint64_t mask = ring_.mask(), at = std::uint64_t{row_} * width_ & mask;
  const std::size_t first =
      static_cast<std::size_t>(std::min<std::uint64_t>(width_, mask + 1 - at));
  std::copy_n(ring_.data() + at, first, out.begin());
  std::copy_n(ring_.data(), width_ - first, out.begin() + static_cast<std::ptrdiff_t>(first));
  ++row_;
}

}  // namespace pounce::io
