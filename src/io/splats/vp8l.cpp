// SPDX-License-Identifier: Apache-2.0
#include "io/splats/vp8l.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint32_t kMostChunks = 64;  // before the image: metadata, each at most once
constexpr std::uint64_t kMostPalette = 256;

[[noreturn]] void refuse(const std::string& name, const std::string& what) {
  throw Error(ErrorKind::input, fmt::format("{}: {}", name, what));
}

[[noreturn]] void refuse_lossy(const std::string& name) {
  refuse(name,
         "is a lossy WebP image (VP8), which changes the values of Gaussians; export the scene "
         "again with lossless WebP images");
}

[[noreturn]] void refuse_animation(const std::string& name) {
  refuse(name, "is an animated WebP image; export the scene again with plain lossless ones");
}

[[noreturn]] void refuse_cut(const std::string& name, std::uint64_t needed, std::uint64_t bytes) {
  refuse(name, fmt::format("ends after {} of at least {} bytes; download it or export it again",
                           bytes, needed));
}

/// The first bytes of a range of a file, checked against its end.
struct Range {
  const ReadFile& file;
  std::uint64_t at, bytes;
  const std::string& name;

  template <std::size_t N>
  std::array<std::uint8_t, N> read(std::uint64_t offset) const {
    if (offset > bytes || bytes - offset < N) refuse_cut(name, offset + N, bytes);
    std::array<std::uint8_t, N> result;
    file.read(at + offset, std::as_writable_bytes(std::span(result)));
    return result;
  }
};

template <std::size_t N>
std::string_view text_of(const std::array<std::uint8_t, N>& bytes, std::size_t at) {
  return {reinterpret_cast<const char*>(bytes.data()) + at, 4};
}

template <std::size_t N>
std::uint32_t number_of(const std::array<std::uint8_t, N>& bytes, std::size_t at,
                        std::size_t count = 4) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value |= std::uint32_t{bytes[at + i]} << (8 * i);
  return value;
}

/// The size and place of the bits of the VP8L chunk whose data begin at `offset`.
Vp8lHeader read_stream_header(const Range& range, std::uint64_t offset, std::uint32_t size) {
  std::array<std::uint8_t, 5> start{};
  if (size >= start.size()) start = range.read<5>(offset);
  if (start[0] != 0x2F)
    refuse(range.name, "does not begin as a lossless WebP image; download it or export it again");
  const std::uint32_t bits = number_of(start, 1);
  if (bits >> 29 != 0) {
    refuse(range.name, fmt::format("is lossless WebP of version {}, and only 0 is known; "
                                   "export the scene again with a plain encoder",
                                   bits >> 29));
  }
  Vp8lHeader header;
  header.width = (bits & 0x3FFF) + 1;
  header.height = (bits >> 14 & 0x3FFF) + 1;
  header.origin = range.at;
  header.stream_at = range.at + offset + start.size();
  header.stream_bytes = size - start.size();
  return header;
}

}  // namespace

Vp8lHeader read_vp8l_header(const ReadFile& file, std::uint64_t at, std::uint64_t bytes,
                            const std::string& name) {
  const Range range{file, at, bytes, name};
  const auto riff = range.read<12>(0);
  if (text_of(riff, 0) != "RIFF" || text_of(riff, 8) != "WEBP")
    refuse(name, "is not a WebP image; export the scene again with lossless WebP images");
  const std::uint64_t end = std::uint64_t{8} + number_of(riff, 4);
  if (end > bytes) refuse_cut(name, end, bytes);
  std::uint32_t canvas_width = 0, canvas_height = 0;
  std::uint64_t offset = riff.size();
  for (std::uint32_t chunk = 0; chunk < kMostChunks && offset + 8 <= end; ++chunk) {
    const auto start = range.read<8>(offset);
    const std::string_view type = text_of(start, 0);
    const std::uint32_t size = number_of(start, 4);
    offset += start.size();
    if (size > end - offset) refuse_cut(name, offset + size, end);
    if (type == "VP8 " || type == "ALPH") refuse_lossy(name);
    if (type == "ANIM" || type == "ANMF") refuse_animation(name);
    if (type == "VP8X") {
      const auto extended = range.read<10>(offset);
      if ((extended[0] & 2) != 0) refuse_animation(name);
      canvas_width = number_of(extended, 4, 3) + 1;
      canvas_height = number_of(extended, 7, 3) + 1;
    } else if (type == "VP8L") {
      const Vp8lHeader header = read_stream_header(range, offset, size);
      if (canvas_width != 0 && (header.width != canvas_width || header.height != canvas_height)) {
        refuse(name, fmt::format("says that it is {} x {} pixels and holds {} x {}; download it or "
                                 "export it again",
                                 canvas_width, canvas_height, header.width, header.height));
      }
      return header;
    }
    offset += size + (size & 1);
  }
  refuse(name,
         "is a WebP file without an image in it (no VP8L chunk); download it or export it again");
}

Vp8lDecoder::Vp8lDecoder(const ReadFile& file, const Vp8lHeader& header, const std::string& name,
                         WriteFile& scratch)
    : header_(header),
      name_(name),
      source_(file, header.stream_at, header.stream_bytes, name, header.origin),
      ring_(std::max(std::uint64_t{header.width} * header.height, kMostPalette)),
      stored_width_(header.width) {
  row_.reserve(header.width);
  read_transforms(scratch);
  pixels_ = std::make_unique<Vp8lPixels>(source_, stored_width_, header.height, ring_, &scratch);
}

void Vp8lDecoder::read_transforms(WriteFile& scratch) {
  std::array<bool, 4> seen{};
  while (source_.read(1) == 1) {
    const std::uint32_t kind = source_.read(2);
    if (seen[kind]) source_.fail("a transform that it had before");
    seen[kind] = true;
    transforms_.push_back(
        read_vp8l_transform(static_cast<Vp8lTransformKind>(kind),
                            {source_, stored_width_, header_.height, ring_, scratch}));
    stored_width_ = transforms_.back()->stored_width(stored_width_);
  }
}

void Vp8lDecoder::read_row(std::span<std::uint8_t> rgba) {
  if (next_row_ == header_.height || rgba.size() != std::size_t{4} * header_.width)
    throw Error(ErrorKind::internal, name_ + ": asked for a row that there is not");
  row_.resize(stored_width_);
  pixels_->read_row(row_);
  for (auto transform = transforms_.rbegin(); transform != transforms_.rend(); ++transform)
    (*transform)->undo(next_row_, row_);
  for (std::size_t x = 0; x < row_.size(); ++x) {
    const std::uint32_t argb = row_[x];
    const std::uint32_t abgr = (argb & 0xFF00FF00) | (argb >> 16 & 0xFF) | (argb & 0xFF) << 16;
    std::memcpy(&rgba[4 * x], &abgr, sizeof abgr);
  }
  ++next_row_;
}

std::uint64_t Vp8lDecoder::memory_bytes() const {
  return (ring_.mask() + 1) * 4 + pixels_->memory_bytes() + kRowBytes;
}

}  // namespace pounce::io
