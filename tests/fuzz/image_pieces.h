// SPDX-License-Identifier: Apache-2.0
//
// What an image file is made of, for a fuzzer that changes one part and keeps the rest.
#pragma once

#include <zlib.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <vector>

namespace pounce::fuzz {

struct Range {
  std::size_t begin = 0, size = 0;
};

class Pieces {
 public:
  Pieces(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::vector<Range> find() {
    if (starts_with("\x89PNG")) {
      png();
    } else if (starts_with("\xFF\xD8")) {
      jpeg();
    } else if (starts_with("\x76\x2f\x31\x01")) {
      exr();
    } else if (starts_with("II") || starts_with("MM")) {
      tiff();
    } else if (starts_with("RIFF")) {
      for (std::size_t at = 12; at + 8 <= size_; at += 8 + (little(at + 4) + 1) / 2 * 2)
        add(at + 8, little(at + 4));
    } else if (starts_with("#?")) {
      constexpr std::string_view kEnd = "\n\n";
      const auto* const end = std::search(data_, data_ + size_, kEnd.begin(), kEnd.end());
      add(0, static_cast<std::size_t>(end - data_) + 24);
      add(static_cast<std::size_t>(end - data_), size_);
    }
    return std::move(found_);
  }

 private:
  void png() {
    for (std::size_t at = 8; at + 12 <= size_; at += 12 + big(at)) {
      add(at + 8, big(at));
      if (big(at) > size_) break;
    }
  }
  void jpeg() {
    std::size_t at = 2;
    while (at + 4 <= size_ && data_[at] == 0xFF) {
      const std::size_t length = std::size_t{data_[at + 2]} << 8 | data_[at + 3];
      add(at + 4, length - std::min<std::size_t>(length, 2));
      const bool scan = data_[at + 1] == 0xDA;
      at += 2 + length;
      if (scan) break;
    }
    add(at, size_);
  }
  /// The attributes, and what follows them: places of the chunks and chunks.
  void exr() {
    std::size_t at = 8;
    const auto skip_text = [&] {
      const auto* const end = std::find(data_ + std::min(at, size_), data_ + size_, 0);
      at = static_cast<std::size_t>(end - data_) + 1;
    };
    while (at < size_ && data_[at] != 0) {
      skip_text();
      skip_text();
      add(at + 4, little(at));
      at += 4 + little(at);
      if (at + 1 < size_ && data_[at] == 0 && data_[at + 1] != 0 && (little(4) & 0x1000) != 0) ++at;
    }
    add(at, 64);
    add(at, size_);
  }
  void tiff() {
    const bool swapped = data_[0] == 'M', large = size_ > 3 && (data_[2] | data_[3]) == 43;
    const auto number = [&](std::size_t at, std::size_t bytes) {
      std::size_t value = 0;
      for (std::size_t i = 0; i < bytes && at + i < size_; ++i)
        value |= std::size_t{data_[at + i]} << 8 * (swapped ? bytes - 1 - i : i);
      return value;
    };
    const std::size_t place = large ? number(8, 8) : number(4, 4), entry = large ? 20 : 12;
    if (place >= size_) return;
    const std::size_t fields = number(place, large ? 8 : 2);
    for (std::size_t i = 0; i < std::min<std::size_t>(fields, 64); ++i) {
      const std::size_t at = place + (large ? 8 : 2) + i * entry;
      add(at, entry);
      add(at + entry - (large ? 8 : 4), 4);
      add(number(at + entry - (large ? 8 : 4), 4), number(at + 4, 4) * 2);
    }
    add(8, place - std::min<std::size_t>(place, 8));
  }

  void add(std::size_t begin, std::size_t size) {
    if (begin < size_ && size > 0) found_.push_back({begin, std::min(size, size_ - begin)});
  }
  bool starts_with(std::string_view text) const {
    return size_ >= text.size() && std::memcmp(data_, text.data(), text.size()) == 0;
  }
  std::size_t little(std::size_t at) const {
    std::uint32_t value = 0;
    if (at + 4 <= size_) std::memcpy(&value, data_ + at, 4);
    return value;
  }
  std::size_t big(std::size_t at) const {
    return __builtin_bswap32(static_cast<std::uint32_t>(little(at)));
  }

  const std::uint8_t* data_;
  std::size_t size_;
  std::vector<Range> found_;
};

inline std::vector<Range> pieces_of(const std::uint8_t* data, std::size_t size) {
  return Pieces(data, size).find();
}

/// Gives each chunk of a PNG the checksum that it needs to be looked at.
inline void mend_checksums(std::uint8_t* data, std::size_t size) {
  if (size < 8 || std::memcmp(data, "\x89PNG", 4) != 0) return;
  for (const Range& chunk : pieces_of(data, size)) {
    const std::size_t end = chunk.begin + chunk.size;
    if (end + 4 > size) break;
    const auto sum =
        static_cast<std::uint32_t>(::crc32_z(0, data + chunk.begin - 4, chunk.size + 4));
    for (std::size_t i = 0; i < 4; ++i)
      data[end + i] = static_cast<std::uint8_t>(sum >> (24 - 8 * i));
  }
}

}  // namespace pounce::fuzz
