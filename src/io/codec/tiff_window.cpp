// SPDX-License-Identifier: Apache-2.0
//
// Both formats let a few bytes ask for gigabytes, and libtiff sets no limit. A stream may hold
// several frames or blocks, each with a statement of its own, so the length of the first one is
// followed to its end: writers of TIFFs write one.
//
// Zstandard is RFC 8878, xz "The .xz File Format" 1.1.
#include "io/codec/tiff_window.h"

#include <algorithm>
#include <array>
#include <string>

namespace pounce::io {
namespace {

/// What is said in a strip or tile, from its begin to its end.
class Stream {
 public:
  Stream(ByteSource& bytes, std::uint64_t begin, std::uint64_t size)
      : at_(bytes, "TIFF", false), place_(begin), end_(begin + size) {}

  /// A whole number, the lowest byte first; 0 beyond the end.
  std::uint64_t take(std::size_t size) {
    const std::uint64_t value = left() < size ? 0 : at_.number(place_, size);
    skip(size);
    return value;
  }
  void skip(std::uint64_t size) { place_ += std::min(size, left()); }
  std::uint64_t left() const { return end_ - place_; }
  std::uint64_t place() const { return place_; }

  [[noreturn]] void refuse(const std::string& what) const {
    at_.refuse(
        fmt::format("a strip or tile of the TIFF {}; save it with ZIP (Deflate) or LZW", what));
  }
  void check(std::uint64_t window) const {
    if (window <= kMostWindowBytes) return;
    refuse(fmt::format("needs {} MiB of memory for its compression, but at most {} are supported",
                       window >> 20, kMostWindowBytes >> 20));
  }

 private:
  Cursor at_;
  std::uint64_t place_, end_;
};

/// A number of seven bits in each byte, the lowest ones first.
std::uint64_t take_varint(Stream& from) {
  std::uint64_t value = 0;
  for (int shift = 0; shift < 63; shift += 7) {
    const std::uint64_t byte = from.take(1);
    value |= (byte & 0x7F) << shift;
    if (byte < 0x80) break;
  }
  return value;
}

/// To the end of the chunks of LZMA2.
void skip_lzma2(Stream& from) {
  constexpr std::uint64_t kEnd = 0, kStored = 2, kCoded = 0x80, kNewProperties = 0xC0;
  while (from.left() > 0) {
    const std::uint64_t control = from.take(1);
    if (control == kEnd) return;
    if (control >= kCoded) from.skip(2);
    const std::uint64_t high = from.take(1), low = from.take(1);
    if (control >= kNewProperties) from.skip(1);
    if (control > kStored && control < kCoded) from.skip(from.left());  // damaged
    from.skip((high << 8 | low) + 1);
  }
}

}  // namespace

std::uint64_t zstd_window(ByteSource& bytes, std::uint64_t begin, std::uint64_t size) {
  Stream from(bytes, begin, size);
  constexpr std::uint64_t kMagic = 0xFD2FB528;
  if (from.take(4) != kMagic) from.refuse("does not begin with a Zstandard frame");
  const std::uint64_t head = from.take(1);
  const bool single = (head & 0x20) != 0;
  std::uint64_t window = 0;
  if (!single) {
    const std::uint64_t said = from.take(1), base = std::uint64_t{1} << (10 + (said >> 3));
    window = base + base / 8 * (said & 7);
  }
  constexpr std::array<std::uint64_t, 4> kDictionaryBytes{0, 1, 2, 4};
  from.skip(kDictionaryBytes[head & 3]);
  const std::size_t size_bytes = head >> 6 == 0 ? (single ? 1 : 0) : std::size_t{1} << (head >> 6);
  const std::uint64_t frame_bytes = from.take(size_bytes);
  if (single) window = frame_bytes + (size_bytes == 2 ? 256 : 0);
  from.check(window);
  for (bool last = false; !last && from.left() > 0;) {
    const std::uint64_t block = from.take(3);
    constexpr std::uint64_t kRepeated = 1;
    last = (block & 1) != 0;
    from.skip((block >> 1 & 3) == kRepeated ? 1 : block >> 3);
  }
  if ((head & 4) != 0) from.skip(4);  // a checksum
  if (from.left() > 0) from.refuse("goes on behind its Zstandard frame");
  return window;
}

std::uint64_t xz_window(ByteSource& bytes, std::uint64_t begin, std::uint64_t size) {
  Stream from(bytes, begin, size);
  constexpr std::uint64_t kMagic = 0x005A587A37FD;
  if (from.take(6) != kMagic) from.refuse("does not begin with an xz stream");
  const std::uint64_t check = from.take(2) >> 8 & 15;
  from.skip(4);
  const std::uint64_t block = from.place(), head_bytes = 4 * (from.take(1) + 1);
  const std::uint64_t flags = from.take(1);
  for (const std::uint64_t flag : {0x40U, 0x80U}) {
    if ((flags & flag) != 0) take_varint(from);
  }
  std::uint64_t filter = 0, property = 0;
  for (std::uint64_t i = 0; i <= (flags & 3); ++i) {
    filter = take_varint(from);
    const std::uint64_t properties = take_varint(from);
    property = properties > 0 ? from.take(1) : 0;
    from.skip(properties - std::min<std::uint64_t>(properties, 1));
  }
  constexpr std::uint64_t kLzma2 = 0x21, kLargest = 40;
  if (filter != kLzma2 || property > kLargest) from.refuse("is not compressed by LZMA2");
  const std::uint64_t window = (2 | (property & 1)) << (property / 2 + 11);
  from.check(window);
  from.skip(block + head_bytes - std::min(block + head_bytes, from.place()));
  skip_lzma2(from);
  from.skip((block - from.place()) % 4);
  constexpr std::array<std::uint64_t, 16> kCheckBytes{0,  4,  4,  4,  8,  8,  8,  16,
                                                      16, 16, 32, 32, 32, 64, 64, 64};
  from.skip(kCheckBytes[check]);
  if (from.take(1) != 0) from.refuse("has more than one xz block");
  return window;
}

}  // namespace pounce::io
