// SPDX-License-Identifier: Apache-2.0
#include "io/image/png_check.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>

// A PNG is an 8-byte signature and chunks of (length, type, data, CRC). libpng compares an IDAT's
// CRC only when it moves on to the next chunk, and whoever stops after the last row never does: a
// flipped bit in the last IDAT would go unnoticed. Following the bytes as they are read anyway
// costs 0.5 ns per encoded byte.
namespace pounce::io {
namespace {

/// Goes on with the CRC-32 of what came before; 0 to begin with.
std::uint32_t crc32(std::uint32_t crc, const std::byte* bytes, std::size_t count) {
  return static_cast<std::uint32_t>(
      ::crc32_z(crc, reinterpret_cast<const unsigned char*>(bytes), count));
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
    crc_ = 0;
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
  if (makes_pixels && number_ != crc_) {
    problem_ = fmt::format(
        "the checksum of its {} chunk is wrong",
        std::all_of(type.begin(), type.end(), [](char c) { return c >= 'A' && c <= 'z'; })
            ? type
            : "unnamed");
  }
  finished_ = type == "IEND";
}

}  // namespace pounce::io
