// SPDX-License-Identifier: Apache-2.0
#include "io/image/guard.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <string_view>
#include <vector>

namespace pounce::io {
namespace {

/// Pictures are in one or a few pieces; what is cut into more was made to be.
constexpr std::size_t kMostPieces = 256;

/// The pieces of a source that are kept.
class Kept {
 public:
  explicit Kept(Cursor& from) : from_(from) {}

  void add(std::uint64_t begin, std::uint64_t end) {
    end = std::min(end, from_.size());
    if (begin >= end) return;
    if (!pieces_.empty() && pieces_.back().offset_bytes + pieces_.back().size_bytes == begin) {
      pieces_.back().size_bytes += end - begin;
      return;
    }
    if (pieces_.size() == kMostPieces)
      from_.refuse(fmt::format(
          "metadata split its image data into more than {} pieces; save it again", kMostPieces));
    pieces_.push_back({begin, end - begin, {}});
  }

  void show() {
    if (pieces_.size() > 1 || (pieces_.size() == 1 && pieces_[0].size_bytes < from_.size()))
      from_.bytes().show_only(std::move(pieces_));
  }

 private:
  Cursor& from_;
  std::vector<ByteSource::Piece> pieces_;
};

/// Chunks of (length, type, data, checksum). Whatever is wrong with those that are kept the decoder
/// and PngCheck say.
void hide_in_png(ByteSource& bytes, std::vector<ColourPiece>& colours) {
  constexpr std::array<std::string_view, 5> kPixels{"IHDR", "PLTE", "tRNS", "IDAT", "IEND"};
  constexpr std::array<std::string_view, 5> kColours{"cICP", "iCCP", "sRGB", "gAMA", "cHRM"};
  Cursor at(bytes, "PNG", true);
  Kept kept(at);
  std::uint64_t position = 8;
  kept.add(0, position);
  while (position + 8 <= at.size()) {
    const std::uint64_t length = at.u32(position);
    std::array<char, 4> letters;
    for (std::size_t i = 0; i < 4; ++i) letters[i] = static_cast<char>(at.u8(position + 4 + i));
    const std::string_view type(letters.data(), letters.size());
    const std::uint64_t end = position + 12 + length;
    const bool optional = (letters[0] & 0x20) != 0;
    if (std::find(kPixels.begin(), kPixels.end(), type) != kPixels.end()) {
      kept.add(position, end);
    } else if (!optional) {
      at.refuse("the PNG has an unknown critical chunk; the file is damaged");
    } else if (end > at.size()) {
      at.refuse(fmt::format(
          "an ancillary chunk of the PNG claims {} bytes, but the file has {}; it is damaged or "
          "truncated",
          length, at.size()));
    } else if (std::find(kColours.begin(), kColours.end(), type) != kColours.end()) {
      keep_colours(at, type, position + 8, length, colours);
    }
    position = end;
    if (type == "IEND") break;
  }
  kept.add(position, at.size());  // what is too short for a chunk: the decoder finds it cut off
  kept.show();
}

/// Does this begin with that text?
bool begins_with(Cursor& at, std::uint64_t begin, std::uint64_t end, std::string_view text) {
  if (end < begin + text.size()) return false;
  return std::all_of(text.begin(), text.end(),
                     [&](char c) { return static_cast<char>(at.u8(begin++)) == c; });
}

/// Segments of (marker, length, data) up to the first scan; JFIF's and Adobe's stay, all of them,
/// which say how colours are coded. Others may use their markers, too.
void hide_in_jpeg(ByteSource& bytes, std::vector<ColourPiece>& colours) {
  using namespace std::string_view_literals;
  constexpr std::uint8_t kJfif = 0xE0, kProfile = 0xE2, kAdobe = 0xEE, kComment = 0xFE;
  constexpr std::uint8_t kScan = 0xDA, kEnd = 0xD9;
  constexpr auto kProfileMark = "ICC_PROFILE\0"sv;
  Cursor at(bytes, "JPEG", true);
  Kept kept(at);
  std::uint64_t position = 2;
  kept.add(0, position);
  for (;;) {
    const std::uint64_t begin = position;
    if (at.u8(position++) != 0xFF) return;  // damaged: read_jpeg_header() says where
    std::uint8_t marker = at.u8(position++);
    while (marker == 0xFF) marker = at.u8(position++);
    if (marker == kScan || marker == kEnd) {
      kept.add(begin, at.size());
      return kept.show();
    }
    const bool alone = marker <= 0x01 || (marker >= 0xD0 && marker <= 0xD8);
    const std::uint64_t data = position + 2;
    if (!alone) position += std::max<std::uint16_t>(2, at.u16(position));
    const bool about = (marker >= 0xE0 && marker <= 0xEF) || marker == kComment;
    const bool of_colour = (marker == kJfif && begins_with(at, data, position, "JFIF\0"sv)) ||
                           (marker == kAdobe && begins_with(at, data, position, "Adobe"sv));
    if (!about || of_colour) kept.add(begin, position);
    if (marker != kProfile || !begins_with(at, data, position, kProfileMark)) continue;
    // Parts of it, numbered, in their order.
    const std::uint64_t part = data + kProfileMark.size() + 2;
    const std::uint64_t size = position > part ? position - part : 0;
    if (colours.empty()) colours.push_back({"ICC", {}});
    if (colours.front().data.size() + size <= kMostColourBytes)
      at.copy(part, size, colours.front().data);
  }
}

/// Chunks of (type, length, data), padded to even lengths. What the header says of those that are
/// hidden goes, too.
void hide_in_webp(ByteSource& bytes, std::vector<ColourPiece>& colours) {
  constexpr std::array<std::string_view, 3> kAbout{"ICCP", "EXIF", "XMP "};
  constexpr std::uint8_t kAboutFlags = 0x20 | 0x08 | 0x04;
  Cursor at(bytes, "WebP", false);
  std::vector<ByteSource::Piece> pieces;
  std::uint64_t kept = 4;  // behind the length: "WEBP"
  bool hides = false;
  for (std::uint64_t position = 12; position + 8 <= at.size();) {
    const std::uint64_t end =
        std::min(position + 8 + (std::uint64_t{at.u32(position + 4)} + 1) / 2 * 2, at.size());
    std::vector<std::byte> chunk;
    std::array<char, 4> letters;
    for (std::size_t i = 0; i < 4; ++i) letters[i] = static_cast<char>(at.u8(position + i));
    const std::string_view type(letters.data(), letters.size());
    if (type == "VP8X" && end - position == 18) {
      for (std::uint64_t i = position; i < end; ++i) chunk.push_back(std::byte{at.u8(i)});
      chunk[8] &= std::byte{static_cast<std::uint8_t>(~kAboutFlags)};
    }
    if (std::find(kAbout.begin(), kAbout.end(), type) != kAbout.end()) {
      hides = true;
      if (type == "ICCP") keep_colours(at, "ICC", position + 8, end - position - 8, colours);
    } else {
      if (pieces.size() == kMostPieces)
        at.refuse(fmt::format("the WebP has more than {} chunks; save it again", kMostPieces));
      pieces.push_back({position, end - position, std::move(chunk)});
      kept += end - position;
    }
    position = end;
  }
  if (!hides || kept > UINT32_MAX) return;
  std::vector<std::byte> head;
  for (std::uint64_t i = 0; i < 12; ++i) {
    const bool length = i >= 4 && i < 8;
    head.push_back(length ? static_cast<std::byte>(kept >> 8 * (i - 4)) : std::byte{at.u8(i)});
  }
  pieces.insert(pieces.begin(), {0, 12, std::move(head)});
  bytes.show_only(std::move(pieces));
}

/// Where the packets of a Targa with run lengths end, which must hold exactly so many texels.
std::uint64_t end_of_targa_packets(Cursor& at, std::uint64_t position, std::uint64_t texels,
                                   std::uint64_t texel_bytes) {
  for (std::uint64_t done = 0; done < texels;) {
    const std::uint8_t head = at.u8(position);
    const std::uint64_t count = (head & 0x7FU) + 1;
    position += 1 + ((head & 0x80) != 0 ? 1 : count) * texel_bytes;
    done += count;
    if (done > texels || position > at.size())
      at.refuse("the Targa's run-length data do not match its size; it is damaged or truncated");
  }
  return position;
}

/// OpenImageIO 2.4 looks beyond the end of a short palette (CVE-2023-22845) and of the texts at the
/// end of the file (CVE-2023-24473): palettes are refused, and header and texels are all that is
/// shown, zeros in the place of what may follow.
void hide_in_targa(ByteSource& bytes) {
  constexpr std::uint64_t kHeaderBytes = 18, kFooterBytes = 26;
  constexpr std::uint8_t kColours = 2, kGrey = 3, kRuns = 8;
  Cursor at(bytes, "Targa", false);
  const std::uint8_t type = at.u8(2), bits = at.u8(16), plain = type & ~kRuns;
  if (at.u8(1) != 0 || plain == 1)
    at.refuse("Targa images with a palette are not supported; convert it to PNG");
  const bool colours = plain == kColours && (bits == 15 || bits == 16 || bits == 24 || bits == 32);
  if (!colours && !(plain == kGrey && bits == 8)) {
    at.refuse(fmt::format(
        "Targa images of type {} with {} bits per texel are not supported; convert it to PNG", type,
        bits));
  }
  const std::uint64_t texels = std::uint64_t{at.u16(12)} * at.u16(14), texel_bytes = (bits + 7) / 8;
  const std::uint64_t begin = kHeaderBytes + at.u8(0);
  const bool runs = (type & kRuns) != 0;
  const std::uint64_t end =
      runs ? end_of_targa_packets(at, begin, texels, texel_bytes) : begin + texels * texel_bytes;
  if (texels == 0) at.refuse("the Targa has no texels; the file is damaged");
  if (end > at.size()) {
    at.refuse(fmt::format(
        "the Targa is truncated: its image data end at byte {}, the file ends at byte {}", end,
        at.size()));
  }
  std::vector<std::byte> header;
  at.copy(0, kHeaderBytes, header);
  header[0] = std::byte{0};  // no text before the texels
  bytes.show_only({{0, kHeaderBytes, std::move(header)},
                   {begin, end - begin, {}},
                   {0, kFooterBytes, std::vector<std::byte>(kFooterBytes)}});
}

}  // namespace

void keep_colours(Cursor& at, std::string_view kind, std::uint64_t begin, std::uint64_t size,
                  std::vector<ColourPiece>& colours) {
  const bool is_there = std::any_of(colours.begin(), colours.end(),
                                    [&](const ColourPiece& piece) { return piece.kind == kind; });
  if (size > kMostColourBytes || is_there) return;
  colours.push_back({std::string(kind), {}});
  at.copy(begin, size, colours.back().data);
}

std::vector<ColourPiece> hide_metadata(ByteSource& bytes, const std::string& format) {
  std::vector<ColourPiece> colours;
  if (format == "png") hide_in_png(bytes, colours);
  if (format == "jpeg") hide_in_jpeg(bytes, colours);
  if (format == "webp") hide_in_webp(bytes, colours);
  if (format == "targa") hide_in_targa(bytes);
  return colours;
}

// A PNG is an 8-byte signature and chunks of (length, type, data, CRC). libpng compares an IDAT's
// CRC only when it moves on to the next chunk, and whoever stops after the last row never does: a
// flipped bit in the last IDAT would go unnoticed. Following the bytes as they are read anyway
// costs 0.5 ns per encoded byte.

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
