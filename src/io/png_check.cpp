// SPDX-License-Identifier: Apache-2.0
#include "io/png_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>

// A PNG is an 8-byte signature and chunks of (length, type, data, CRC). libpng compares an IDAT's
// CRC only when it moves on to the next chunk, and whoever stops after the last row never does: a
// flipped bit in the last IDAT would go unnoticed. Following the bytes as they are read anyway
// costs 0.5 ns per encoded byte.
namespace pounce::io {
namespace {

/// Tables of the CRC-32 of PNG and zip (polynomial 0xEDB88320), eight bytes per step.
struct CrcTables {
  std::array<std::array<std::uint32_t, 256>, 8> of{};
  constexpr CrcTables() {
    for (std::uint32_t n = 0; n < 256; ++n) {
      std::uint32_t c = n;
      for (int bit = 0; bit < 8; ++bit) c = (c & 1U) != 0 ? 0xEDB88320U ^ (c >> 1) : c >> 1;
      of[0][n] = c;
    }
    for (std::size_t k = 1; k < 8; ++k) {
      for (std::size_t n = 0; n < 256; ++n) {
        of[k][n] = of[0][of[k - 1][n] & 255U] ^ (of[k - 1][n] >> 8);
      }
    }
  }
};
constexpr CrcTables kCrc;

std::uint32_t crc32(std::uint32_t crc, const std::byte* bytes, std::size_t count) {
  static_assert(std::endian::native == std::endian::little);
  for (; count >= 8; bytes += 8, count -= 8) {
    std::uint32_t low = 0, high = 0;
    std::memcpy(&low, bytes, 4);
    std::memcpy(&high, bytes + 4, 4);
    low ^= crc;
    crc = kCrc.of[7][low & 255U] ^ kCrc.of[6][(low >> 8) & 255U] ^ kCrc.of[5][(low >> 16) & 255U] ^
          kCrc.of[4][low >> 24] ^ kCrc.of[3][high & 255U] ^ kCrc.of[2][(high >> 8) & 255U] ^
          kCrc.of[1][(high >> 16) & 255U] ^ kCrc.of[0][high >> 24];
  }
  for (; count > 0; ++bytes, --count) {
    crc = kCrc.of[0][(crc ^ static_cast<std::uint32_t>(*bytes)) & 255U] ^ (crc >> 8);
  }
  return crc;
}

}  // namespace

void PngCheck::see(std::uint64_t offset, const std::byte* bytes, std::size_t count) {
  if (offset > position_ || offset + count <= position_) return;
  const std::size_t seen = static_cast<std::size_t>(position_ - offset);
  bytes += seen;
  count -= seen;
  while (count > 0 && !finished_ && problem_.empty()) {
    const std::size_t piece = std::min<std::size_t>(count, left_);
    step(bytes, piece);
    bytes += piece;
    count -= piece;
    position_ += piece;
  }
  position_ += count;
}

void PngCheck::step(const std::byte* bytes, std::size_t count) {
  if (part_ == Part::header || part_ == Part::checksum) {
    for (std::size_t i = 0; i < count; ++i) {
      // The second half of a header is the type, which the checksum covers.
      if (part_ == Part::header && left_ - i <= 4) {
        if (left_ - i == 4) length_ = number_;
        type_[4 - (left_ - i)] = static_cast<char>(bytes[i]);
        crc_ = crc32(crc_, bytes + i, 1);
      }
      number_ = (number_ << 8) | static_cast<std::uint32_t>(bytes[i]);
    }
  } else if (part_ == Part::data) {
    crc_ = crc32(crc_, bytes, count);
  }
  left_ -= static_cast<std::uint32_t>(count);
  if (left_ > 0) return;
  if (part_ == Part::header) {
    end_of_header();
  } else if (part_ == Part::data) {
    part_ = Part::checksum;
    left_ = 4;
  } else {
    if (part_ == Part::checksum) end_of_checksum();
    part_ = Part::header;
    left_ = 8;
    crc_ = 0xFFFFFFFFU;
  }
}

void PngCheck::end_of_header() {
  if (length_ > 0x7FFFFFFFU) problem_ = fmt::format("a chunk claims {} bytes", length_);
  part_ = length_ > 0 ? Part::data : Part::checksum;
  left_ = length_ > 0 ? length_ : 4;
}

void PngCheck::end_of_checksum() {
  const std::string_view type(type_.data(), type_.size());
  // Chunks with a capital first letter are critical; of the others only tRNS makes pixels.
  const bool makes_pixels = (type[0] & 0x20) == 0 || type == "tRNS";
  if (makes_pixels && number_ != (crc_ ^ 0xFFFFFFFFU)) {
    problem_ = fmt::format(
        "the checksum of its {} chunk is wrong",
        std::all_of(type.begin(), type.end(), [](char c) { return c >= 'A' && c <= 'z'; })
            ? type
            : "unnamed");
  }
  finished_ = type == "IEND";
}

}  // namespace pounce::io
