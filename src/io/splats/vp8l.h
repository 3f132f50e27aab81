// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/page_pool.h"

namespace pounce::io {

/// Bits that were read ahead: what a decoding loop keeps in registers.
struct BitState {
  const std::byte* next = nullptr;  ///< the first byte of which `bits` may not hold all bits
  const std::byte* safe = nullptr;  ///< while next < safe, three refills need not ask for bytes
  std::uint64_t bits = 0;           ///< the next one is the lowest
  std::uint32_t count = 0;          ///< how many of them are sure

  /// Makes at least 56 bits sure. Those above are of the same stream: taking them in again later
  /// changes nothing.
  void refill() {
    std::uint64_t word;
    std::memcpy(&word, next, sizeof word);
    bits |= word << count;
    next += (63 - count) >> 3;
    count |= 56;
  }
  void skip(std::uint32_t n) {
    bits >>= n;
    count -= n;
  }
  /// Up to 31 bits; refill() has made them sure.
  std::uint32_t take(std::uint32_t n) {
    const std::uint32_t value = static_cast<std::uint32_t>(bits) & ((1U << n) - 1);
    skip(n);
    return value;
  }
};

/// The bits of a stretch of a file, the lowest of each byte first, read in pieces of 64 KiB.
class BitSource {
 public:
  /// `bytes` bytes of `file` from `at`, which must outlive this. `name` is what messages call the
  /// image, `origin` where it begins in the file: they count bytes from there.
  BitSource(const ReadFile& file, std::uint64_t at, std::uint64_t bytes, std::string name,
            std::uint64_t origin);

  /// The next `n` <= 31 bits, zeros behind the end: see check().
  std::uint32_t read(std::uint32_t n) { return sure().take(n); }
  /// The state with 56 bits sure.
  BitState& sure() {
    if (state_.next >= state_.safe) state_ = more(state_);
    state_.refill();
    return state_;
  }

  /// For loops that keep a copy: to be put back with set() before anything else is called here.
  const BitState& state() const { return state_; }
  void set(const BitState& state) { state_ = state; }
  /// `state` with more bytes behind it. Throws Error(input) where the end was long passed.
  BitState more(const BitState& state);

  /// Throws Error(input) if more bits were taken than there are.
  void check() const;
  /// Throws Error(input): what is wrong at the present place.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::uint64_t bits_taken() const;

  const ReadFile& file_;
  std::uint64_t at_, bytes_, origin_;
  std::string name_;
  std::vector<std::byte> buffer_;
  std::uint64_t loaded_ = 0;     ///< bytes that were read so far
  std::uint64_t buffer_at_ = 0;  ///< of the stretch: its first byte in the buffer
  BitState state_;
};

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

/// One value per block of an image: written row by row into a scratch file, read again in order
/// with one row in memory. Blocks are squares of 4 to 512 pixels, so the largest image has 4096
/// rows of 4096 of them.
template <class Value>
class Vp8lBlocks {
 public:
  /// Blocks of 2^`bits` pixels of an image `width` pixels wide. `scratch` must outlive this.
  Vp8lBlocks(std::uint32_t width, std::uint32_t bits, WriteFile& scratch)
      : bits_(bits), scratch_(scratch), begin_(scratch.size_bytes()), row_(size(width)) {}

  std::uint32_t bits() const { return bits_; }
  /// How many blocks cover so many pixels.
  std::uint32_t size(std::uint32_t pixels) const { return (pixels + (1U << bits_) - 1) >> bits_; }

  /// Adds the next row. Nothing else may be appended to the file before the last one.
  void append(std::span<const Value> row) { scratch_.append(std::as_bytes(row)); }
  /// The values for row `y` of pixels; all have been added.
  std::span<const Value> row(std::uint32_t y) {
    const std::uint32_t wanted = y >> bits_;
    if (wanted != held_) {
      if (reader_ == nullptr) reader_ = scratch_.reader();
      const auto bytes = std::as_writable_bytes(std::span(row_));
      reader_->read(begin_ + std::uint64_t{wanted} * bytes.size(), bytes);
      held_ = wanted;
    }
    return row_;
  }

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  std::uint32_t bits_;
  WriteFile& scratch_;
  std::unique_ptr<ReadFile> reader_;
  std::uint64_t begin_;
  std::vector<Value> row_;
  std::uint32_t held_ = kNone;
};

/// The last pixels that were decoded, as alpha << 24 | red << 16 | green << 8 | blue: as many as a
/// copy reaches back, or all of a smaller image.
class PixelRing {
 public:
  static constexpr std::uint64_t kMostPixels = 1 << 20;  ///< 4 MiB

  /// For images of up to `pixels` pixels.
  explicit PixelRing(std::uint64_t pixels);
  std::uint32_t* data() { return pixels_.data(); }
  std::uint64_t mask() const { return pixels_.size() - 1; }

 private:
  PageVector<std::uint32_t> pixels_;
};

/// Decodes the pixels of an image, the main one or one of those that steer it, in order.
class Vp8lPixels {
 public:
  /// Memory that the codes of an image may take: the encoders in use stay below it.
  static constexpr std::uint64_t kMostCodeBytes = 32 << 20;

  /// Reads what comes before the pixels: the size of the colour cache, with `scratch` (the main
  /// image) which blocks have which codes, and the codes. All references must outlive this, and the
  /// ring is its own until its last row. Throws Error(input), Error(storage).
  Vp8lPixels(BitSource& source, std::uint32_t width, std::uint32_t height, PixelRing& ring,
             WriteFile* scratch);

  /// The next row, `width` pixels. Throws Error(input), Error(storage).
  void read_row(std::span<std::uint32_t> out);
  /// What codes and colour cache take.
  std::uint64_t memory_bytes() const;

 private:
  void read_group_image(WriteFile& scratch);
  void read_groups();
  template <bool kHasCache>
  void decode_row();
  template <bool kHasCache>
  BitState copy(BitState state, std::uint32_t length_symbol, const PrefixCode& distances);
  std::uint32_t cache_slot(std::uint32_t pixel) const {
    return (pixel * 0x1E35A7BDU) >> cache_shift_;
  }

  BitSource& source_;
  std::uint32_t width_, height_;
  PixelRing& ring_;
  std::uint64_t position_ = 0;  ///< pixels decoded; a copy may have gone beyond the present row
  std::uint32_t row_ = 0;
  std::uint32_t cache_shift_ = 0;
  std::vector<std::uint32_t> cache_;  ///< by the highest bits of a hash
  PrefixTables tables_;
  std::vector<PrefixGroup> groups_;
  std::optional<Vp8lBlocks<std::uint16_t>> group_of_block_;
  std::vector<bool> group_is_used_;
};

// --- images --------------------------------------------------------------------------------------

/// A row of pixels, alpha << 24 | red << 16 | green << 8 | blue.
using PixelRow = std::vector<std::uint32_t>;

/// One of the ways in which an encoder prepares an image, undone row by row.
class Vp8lTransform {
 public:
  virtual ~Vp8lTransform() = default;
  /// Undoes row `y`; rows come in order. Grows the row where it held several pixels in one.
  virtual void undo(std::uint32_t y, PixelRow& row) = 0;
  /// The width of the image that is stored, where that of the result is `width`.
  virtual std::uint32_t stored_width(std::uint32_t width) const { return width; }
};

/// A lossless WebP image in a file.
struct Vp8lHeader {
  std::uint32_t width = 0, height = 0;  ///< 1 to 16384
  std::uint64_t origin = 0;             ///< where the image begins in the file
  std::uint64_t stream_at = 0;          ///< where its bits do, behind its size
  std::uint64_t stream_bytes = 0;
};

/// Reads the header of the WebP image in `bytes` bytes of `file` from `at`. `name` is what messages
/// call it. Throws Error(input) naming what it is instead (lossy, animated, no WebP at all, cut
/// off) and the cure, Error(storage).
Vp8lHeader read_vp8l_header(const ReadFile& file, std::uint64_t at, std::uint64_t bytes,
                            const std::string& name);

/// Decodes a lossless WebP image row by row, without holding it: RFC 9649. Not thread-safe.
///
/// Memory does not grow with the number of pixels beyond 2^20: 4 MiB for what copies may reach
/// back to, at most 32 MiB for prefix codes (more are refused; encoders of today stay far below),
/// and less than 400 KiB besides. Values per block (predictors, factors between colours, groups of
/// codes) go to a scratch file: 6 bytes per 16 pixels at most, so no more than 96 MiB.
class Vp8lDecoder {
 public:
  /// Bytes read ahead, rows of pixels, rows of blocks, and the codes of an image of blocks.
  static constexpr std::uint64_t kRowBytes = 400 << 10;
  static constexpr std::uint64_t kMostBytes =
      PixelRing::kMostPixels * 4 + Vp8lPixels::kMostCodeBytes + kRowBytes;

  /// Reads all that comes before the pixels. `file` and `scratch` must outlive this; nobody else
  /// may append to the scratch file meanwhile. Throws Error(input), Error(storage).
  Vp8lDecoder(const ReadFile& file, const Vp8lHeader& header, const std::string& name,
              WriteFile& scratch);

  /// The next row as red, green, blue, alpha (straight, not multiplied into the colours), 4 * width
  /// bytes; `height` times at most. Throws Error(input) where the image is damaged, Error(storage).
  void read_row(std::span<std::uint8_t> rgba);
  /// What this takes, no more than kMostBytes.
  std::uint64_t memory_bytes() const;

 private:
  void read_transforms(WriteFile& scratch);

  Vp8lHeader header_;
  std::string name_;
  BitSource source_;
  PixelRing ring_;
  std::uint32_t stored_width_;
  std::vector<std::unique_ptr<Vp8lTransform>> transforms_;  ///< in the order they were applied
  std::unique_ptr<Vp8lPixels> pixels_;
  PixelRow row_;
  std::uint32_t next_row_ = 0;
};

}  // namespace pounce::io
