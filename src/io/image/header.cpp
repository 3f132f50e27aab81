// SPDX-License-Identifier: Apache-2.0
//
// The one door to the decoders: each is code that a stranger's file would reach. Here it is decided
// which one is asked, by what the file holds, whatever it or the model around it says that it were.
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
  std::string_view name;   ///< the code's, or for people
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

}  // namespace pounce::io
