// SPDX-License-Identifier: Apache-2.0
//
// The one door to the decoders: OpenImageIO knows thirty formats and guesses among them, and each
// is code that a stranger's file would reach. Here it is decided which decoder is asked, by what
// the file holds, whatever it or the model around it says that it were.
#include "io/image/header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <string_view>

#include "pounce/error.h"

namespace pounce::io {
namespace {

using namespace std::string_view_literals;

struct Format {
  std::string_view start;  ///< of a file
  std::string_view name;   ///< OpenImageIO's, or for people
};

constexpr auto kRead = std::to_array<Format>({{"\x89PNG\r\n\x1a\n"sv, "png"sv},
                                              {"\xFF\xD8\xFF"sv, "jpeg"sv},
                                              {"\x76\x2f\x31\x01"sv, "openexr"sv},
                                              {"II*\0"sv, "tiff"sv},
                                              {"MM\0*"sv, "tiff"sv},
                                              {"II+\0"sv, "tiff"sv},
                                              {"MM\0+"sv, "tiff"sv},
                                              {"#?RADIANCE"sv, "hdr"sv},
                                              {"#?RGBE"sv, "hdr"sv}});
constexpr auto kNotRead = std::to_array<Format>({{"GIF8"sv, "GIF"sv},
                                                 {"8BPS"sv, "PSD"sv},
                                                 {"SDPX"sv, "DPX"sv},
                                                 {"XPDS"sv, "DPX"sv},
                                                 {"\x80\x2A\x5F\xD7"sv, "Cineon"sv},
                                                 {"DDS "sv, "DDS"sv},
                                                 {"\0\0\1\0"sv, "ICO"sv},
                                                 {"\x01\xDA"sv, "SGI"sv},
                                                 {"\x53\x80\xF6\x34"sv, "Softimage PIC"sv},
                                                 {"\0\0\0\x0CjP  "sv, "JPEG 2000"sv},
                                                 {"\xFF\x4F\xFF\x51"sv, "JPEG 2000"sv},
                                                 {"SIMPLE  ="sv, "FITS"sv}});

bool is_pnm(std::string_view start, std::string_view kinds) {
  return start.size() > 2 && start[0] == 'P' && kinds.find(start[1]) != std::string_view::npos &&
         (start[2] == '#' || start[2] <= ' ');
}

bool is_riff_webp(std::string_view start) {
  return start.starts_with("RIFF"sv) && start.size() >= 12 && start.substr(8, 4) == "WEBP"sv;
}

/// Its header has no mark, but few values that it may have; version 2 has a footer.
bool is_targa(ByteSource& bytes, std::string_view start) {
  constexpr std::string_view kFooter = "TRUEVISION-XFILE.\0"sv;
  std::array<char, 18> footer{};
  if (bytes.size_bytes() >= 44)
    bytes.read_at(bytes.size_bytes() - 18, footer.data(), footer.size());
  if (std::string_view(footer.data(), footer.size()) == kFooter) return true;
  if (start.size() < 18) return false;
  const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(start[at]); };
  const int plain = byte(2) & ~8, bits = byte(16);
  const bool sized = (byte(12) | byte(13)) != 0 && (byte(14) | byte(15)) != 0;
  return byte(1) <= 1 && plain >= 1 && plain <= 3 && sized &&
         (bits == 8 || bits == 15 || bits == 16 || bits == 24 || bits == 32) &&
         (byte(17) & 0xC0) == 0;
}

/// Of a command line.
std::string recipe(const std::string& path, const std::string& to) {
  const std::string::size_type slash = path.rfind('/'), dot = path.rfind('.');
  const bool plain =
      !path.empty() && path[0] != '-' && std::all_of(path.begin(), path.end(), [](unsigned char c) {
        return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
               c >= 0x80 ||
               std::string_view("/._-+,=@%").find(static_cast<char>(c)) != std::string_view::npos;
      });
  if (!plain) return "convert it to PNG or EXR";
  const bool ends = dot != std::string::npos && (slash == std::string::npos || dot > slash + 1);
  return fmt::format("convert it: oiiotool {} -o {}.{}", path, ends ? path.substr(0, dot) : path,
                     to);
}

/// How a file is converted; of what lies within a file only that it should be.
std::string cure(const ByteSource& bytes, const std::string& path) {
  return recipe(bytes.label() == path ? path : "", "png");
}

[[noreturn]] void refuse(const ByteSource& bytes, const std::string& what) {
  throw Error(ErrorKind::input, bytes.label() + ": " + what);
}

std::optional<std::string_view> find(std::span<const Format> formats, std::string_view start) {
  const auto found = std::find_if(formats.begin(), formats.end(), [&](const Format& format) {
    return start.starts_with(format.start);
  });
  return found == formats.end() ? std::nullopt : std::optional(found->name);
}

}  // namespace

std::string image_format(ByteSource& bytes, const std::string& path,
                         std::span<const ImageFormat> allowed) {
  std::array<char, 18> buffer{};
  const std::string_view start(buffer.data(), bytes.read_at(0, buffer.data(), buffer.size()));
  bytes.check();
  if (const auto name = find(kRead, start)) return std::string(*name);
  if (is_riff_webp(start)) return "webp";
  if (is_pnm(start, "56")) return "pnm";
  const auto if_allowed = [&](ImageFormat format, const char* name, const char* people) {
    if (std::find(allowed.begin(), allowed.end(), format) != allowed.end())
      return std::string(name);
    refuse(
        bytes,
        fmt::format("{} images are read only with --allow-format {}; add it if you trust the file, "
                    "or {}",
                    people, image_format_name(format), cure(bytes, path)));
  };
  if (start.starts_with("BM"sv)) return if_allowed(ImageFormat::bmp, "bmp", "BMP");
  std::optional<std::string_view> other = find(kNotRead, start);
  if (!other && is_pnm(start, "1234Ff")) other = "text PNM, bitmap or PFM"sv;
  if (!other && is_targa(bytes, start)) return if_allowed(ImageFormat::tga, "targa", "Targa");
  bytes.check();
  if (other)
    refuse(bytes, fmt::format("{} images are not supported; {}", *other, cure(bytes, path)));
  refuse(bytes, "not an image in a supported format (PNG, JPEG, EXR, TIFF, WebP, HDR, binary PNM)");
}

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
              "{}: the JPEG ends before its first row (after {} bytes); the file is truncated",
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
    throw Error(
        ErrorKind::input,
        fmt::format(
            "{}: a run-length encoded BMP of {} x {} texels is too large; convert it to PNG",
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
              fmt::format("{}: the image header cannot be read; the file is damaged or truncated",
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
        throw Error(
            ErrorKind::input,
            fmt::format("{}: the JPEG has more than {} scans (about 10 are usual); save it again",
                        bytes.label(), kMostScans));
      }
      break;
    }
    at.position = next;
  }
  if (header.width == 0 || header.height == 0) {
    throw Error(
        ErrorKind::input,
        fmt::format("{}: the JPEG does not state its size; the file is damaged", bytes.label()));
  }
  return header;
}

namespace {

/// The text before the picture: "P6 width height largest" and one white space, with comments from #
/// to the end of a line.
class PnmHeader {
 public:
  explicit PnmHeader(ByteSource& bytes) : bytes_(bytes) { next(); }

  int next() {
    if (at_ == count_) {
      position_ += count_;
      count_ = bytes_.read_at(position_, window_.data(), window_.size());
      at_ = 0;
    }
    return last_ = at_ < count_ ? static_cast<unsigned char>(window_[at_++]) : -1;
  }
  /// The next number, and one byte behind it; 0 if there is none.
  std::uint32_t number() {
    while (last_ == '#' || is_white(last_)) {
      const bool comment = last_ == '#';
      while (comment && last_ != '\n' && last_ >= 0) next();
      next();
    }
    std::uint32_t value = 0;
    for (; last_ >= '0' && last_ <= '9'; next()) {
      if (value > 9'999'999) return 0;
      value = value * 10 + static_cast<std::uint32_t>(last_ - '0');
    }
    return is_white(last_) || last_ == '#' ? value : 0;
  }
  /// Behind the byte read last.
  std::uint64_t position() const { return position_ + at_; }

 private:
  static bool is_white(int c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

  ByteSource& bytes_;
  std::array<char, 4096> window_;
  std::uint64_t position_ = 0;
  std::size_t at_ = 0, count_ = 0;
  int last_ = -1;
};

}  // namespace

PnmPicture::PnmPicture(ByteSource& bytes) : bytes_(bytes) {
  PnmHeader header(bytes);
  channels_ = header.next() == '6' ? 3 : 1;
  header.next();
  for (std::uint32_t* number : {&width_, &height_, &largest_}) *number = header.number();
  begin_ = header.position();
  bytes.check();
  if (width_ == 0 || height_ == 0 || largest_ == 0 || largest_ > 65535) {
    throw Error(
        ErrorKind::input,
        bytes.label() + ": the image header cannot be read; the PNM is damaged or truncated");
  }
  const std::uint64_t end = begin_ + row_bytes() * height_;
  if (end > bytes.size_bytes()) {
    throw Error(
        ErrorKind::input,
        fmt::format(
            "{}: the PNM is truncated: its image data end at byte {}, the file ends at byte {}",
            bytes.label(), end, bytes.size_bytes()));
  }
}

std::uint64_t PnmPicture::row_bytes() const {
  return std::uint64_t{width_} * channels_ * (largest_ > 255 ? 2 : 1);
}

void PnmPicture::read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) {
  const std::size_t size = static_cast<std::size_t>(row_bytes() * count);
  const std::size_t got = bytes_.read_at(begin_ + row_bytes() * first, rows, size);
  std::memset(rows + got, 0, size - got);
  const bool wide = largest_ > 255;
  const std::uint32_t full = wide ? 65535 : 255;
  if (!wide && largest_ == full) return;
  for (std::size_t i = 0; i < size; i += wide ? 2 : 1) {
    const auto high = static_cast<std::uint32_t>(rows[i]);
    const std::uint32_t stored = wide ? high << 8 | static_cast<std::uint32_t>(rows[i + 1]) : high;
    // 65535 * 65535 + 32767 fits.
    const std::uint32_t value = (std::min(stored, largest_) * full + largest_ / 2) / largest_;
    if (wide) {
      const auto sample = static_cast<std::uint16_t>(value);
      std::memcpy(rows + i, &sample, sizeof sample);
    } else {
      rows[i] = static_cast<std::byte>(value);
    }
  }
}

}  // namespace pounce::io
