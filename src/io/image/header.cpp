// SPDX-License-Identifier: Apache-2.0
#include "io/image/header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <optional>
#include <string_view>

#include "pounce/error.h"

namespace pounce::io {
namespace {

/// Reads big-endian numbers from a JPEG one after another.
class JpegCursor {
 public:
  explicit JpegCursor(ByteSource& bytes) : bytes_(bytes) {}
  std::uint64_t position = 2;
  std::uint32_t u8() {
    std::uint8_t value = 0;
    if (bytes_.read_at(position++, &value, 1) != 1) {
      bytes_.check();
      throw Error(
          ErrorKind::input,
          fmt::format(
              "{}: the JPEG ends before its first row (after {} bytes); the file was cut off",
              bytes_.label(), bytes_.size_bytes()));
    }
    return value;
  }
  std::uint32_t u16() {
    const std::uint32_t high = u8();
    return (high << 8) | u8();
  }

 private:
  ByteSource& bytes_;
};

bool is_frame_header(std::uint32_t marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

void read_frame_header(JpegCursor at, std::uint32_t marker, JpegHeader& header) {
  at.u8();  // bits per sample
  header.height = at.u16();
  header.width = at.u16();
  header.components = at.u8();
  header.several_scans = marker != 0xC0 && marker != 0xC1 && marker != 0xC9;
  std::array<std::uint32_t, 4> across{}, down{};
  const std::size_t count = std::min<std::size_t>(header.components, 4);
  for (std::size_t c = 0; c < count; ++c) {
    at.u8();  // id
    const std::uint32_t factors = at.u8();
    across[c] = std::clamp(factors >> 4, 1U, 4U);
    down[c] = std::clamp(factors & 15U, 1U, 4U);
    at.u8();  // quantisation table
  }
  const std::uint64_t most_across = std::max(1U, *std::max_element(across.begin(), across.end()));
  const std::uint64_t most_down = std::max(1U, *std::max_element(down.begin(), down.end()));
  // libjpeg keeps 2 bytes per coefficient, padded to whole interleaved units.
  const std::uint64_t units_across = (header.width + 8 * most_across - 1) / (8 * most_across);
  const std::uint64_t units_down = (header.height + 8 * most_down - 1) / (8 * most_down);
  for (std::size_t c = 0; c < count; ++c) {
    header.coefficient_bytes += units_across * units_down * across[c] * down[c] * 128;
  }
}

/// How many scans there are from this place on, which is behind the header of the first one: up to
/// one more than `most`. Data of a scan holds FF only before 00 and restart marks.
std::uint32_t count_scans(ByteSource& bytes, std::uint64_t position, std::uint32_t most) {
  constexpr std::uint8_t kScan = 0xDA, kEnd = 0xD9;
  std::array<std::uint8_t, 65536> window;
  std::uint32_t scans = 1;
  std::uint8_t last = 0;
  while (scans <= most) {
    const std::size_t count = bytes.read_at(position, window.data(), window.size());
    for (std::size_t i = 0; i < count; last = window[i++]) {
      if (last != 0xFF) continue;
      if (window[i] == kEnd) return scans;
      if (window[i] == kScan && ++scans > most) return scans;
    }
    if (count == 0) break;
    position += count;
  }
  bytes.check();
  return scans;
}

/// The first chunk says it all.
std::optional<WholeHeader> webp_header(ByteSource& bytes) {
  std::array<std::uint8_t, 30> b{};
  if (bytes.read_at(0, b.data(), b.size()) < 25) return std::nullopt;
  const std::string_view chunk(reinterpret_cast<const char*>(b.data()) + 12, 4);
  const auto number = [&](std::size_t at, int size) {
    std::uint32_t value = 0;
    for (int i = size - 1; i >= 0; --i) value = value << 8 | b[at + static_cast<std::size_t>(i)];
    return value;
  };
  WholeHeader header;
  if (chunk == "VP8 ") {
    header = {number(26, 2) & 0x3FFFU, number(28, 2) & 0x3FFFU, 3, Depth::u8, false, 0};
  } else if (chunk == "VP8L") {
    const std::uint32_t bits = number(21, 4);
    header = {
        (bits & 0x3FFFU) + 1, (bits >> 14 & 0x3FFFU) + 1, 3, Depth::u8, (bits >> 28 & 1U) != 0, 0};
  } else if (chunk == "VP8X") {
    header = {number(24, 3) + 1, number(27, 3) + 1, 3, Depth::u8, (b[20] & 0x10U) != 0, 0};
  } else {
    return std::nullopt;
  }
  header.channels += header.has_alpha ? 1 : 0;
  // libwebp keeps all texels of a lossless one in four bytes, and 17 rows more; of others some
  // rows. An extended one is either.
  const std::uint64_t width = header.width, height = header.height;
  header.working_bytes = chunk == "VP8 " ? width * 128 : width * (height + 17) * 4;
  return header;
}

/// A BMP's header with its windows version's fields, the lowest byte first.
struct BmpHeader {
  std::int64_t width = 0, height = 0;
  std::uint32_t bits = 0, compression = 0;
  bool has_runs() const { return compression == 1 || compression == 2; }  // RLE8, RLE4
};

/// Nothing if it has another header, which knows no compression.
std::optional<BmpHeader> bmp_header(ByteSource& bytes) {
  std::array<std::uint8_t, 34> b{};
  if (bytes.read_at(0, b.data(), b.size()) < b.size()) return std::nullopt;
  const auto number = [&](std::size_t at) {
    return b[at] | b[at + 1] << 8 | b[at + 2] << 16 | static_cast<std::uint32_t>(b[at + 3]) << 24;
  };
  if (number(14) < 40) return std::nullopt;
  const auto side = [&](std::size_t at) {
    return std::int64_t{static_cast<std::int32_t>(number(at))};
  };
  return BmpHeader{side(18), std::abs(side(22)), number(28) & 0xFFFFU, number(30)};
}

/// Always three channels: see ImageReader.
std::optional<WholeHeader> bmp_runs_header(ByteSource& bytes) {
  const std::optional<BmpHeader> header = bmp_header(bytes);
  // For other bits the decoder has no palette, and looks into it.
  if (!header || header->bits != (header->compression == 1 ? 8U : 4U)) return std::nullopt;
  constexpr std::int64_t kMostTexels = INT32_MAX;  // it counts them in int
  if (header->width > 0 && header->height > kMostTexels / header->width) {
    throw Error(ErrorKind::input,
                fmt::format("{}: a BMP with run lengths of {} x {} texels; convert it to PNG",
                            bytes.label(), header->width, header->height));
  }
  const auto side = [](std::int64_t n) {
    return static_cast<std::uint32_t>(std::max<std::int64_t>(n, 0));
  };
  return WholeHeader{side(header->width), side(header->height), 3, Depth::u8, false, 0};
}

}  // namespace

bool is_interlaced_png(ByteSource& bytes) {
  std::uint8_t method = 0;  // the last byte of IHDR, which is always the first chunk
  return bytes.read_at(28, &method, 1) == 1 && method != 0;
}

bool opens_whole(ByteSource& bytes, const std::string& format) {
  if (format == "webp") return true;
  if (format != "bmp") return false;
  const std::optional<BmpHeader> header = bmp_header(bytes);
  return header && header->has_runs();
}

WholeHeader read_whole_header(ByteSource& bytes, const std::string& format) {
  const auto header = format == "webp" ? webp_header(bytes) : bmp_runs_header(bytes);
  bytes.check();
  if (header) return *header;
  throw Error(ErrorKind::input,
              fmt::format("{}: the image header cannot be read; the file is damaged or cut off",
                          bytes.label()));
}

JpegHeader read_jpeg_header(ByteSource& bytes) {
  JpegHeader header;
  JpegCursor at(bytes);
  for (;;) {
    if (at.u8() != 0xFF) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: the JPEG is damaged before its first row, at byte {}",
                              bytes.label(), at.position - 1));
    }
    std::uint32_t marker = at.u8();
    while (marker == 0xFF) marker = at.u8();
    const bool stands_alone =
        marker == 0x00 || marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8);
    if (stands_alone) continue;
    if (marker == 0xD9) break;
    const std::uint64_t next = at.position + std::max<std::uint64_t>(2, at.u16());
    if (is_frame_header(marker)) read_frame_header(at, marker, header);
    if (marker == 0xDA) {
      header.several_scans = header.several_scans || at.u8() < header.components;
      // Each goes over the whole picture. libjpeg-turbo's own programs stop there.
      constexpr std::uint32_t kMostScans = 500;
      if (header.several_scans && count_scans(bytes, next, kMostScans) > kMostScans) {
        throw Error(ErrorKind::input,
                    fmt::format("{}: the JPEG is in more than {} scans, of which pictures have 10 "
                                "or so; save it again, or it was made to waste time",
                                bytes.label(), kMostScans));
      }
      break;
    }
    at.position = next;
  }
  if (header.width == 0 || header.height == 0) {
    throw Error(ErrorKind::input,
                fmt::format("{}: the JPEG does not say how large it is; the file is damaged",
                            bytes.label()));
  }
  return header;
}

}  // namespace pounce::io
