// SPDX-License-Identifier: Apache-2.0
#include "io/image/write.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/page_pool.h"
#include "io/codec/row_encoder.h"
#include "io/codec/sample.h"
#include "io/files/asset_file.h"
#include "io/files/output_file.h"
#include "mesh/lattice.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// What a second or fourth channel may be: alpha, or also data, which may have a name.
enum class Holds { alpha, data, names };

struct Format {
  const char* name;
  std::array<std::string_view, 3> endings;
  const char* holds;
  std::array<Depth, 4> depth_for;  // nearest by wanted depth: u8, u16, half, float32
  std::uint32_t largest_side;
  const char* title;
  Holds channels;
};

constexpr std::array<Format, 4> kFormats{{
    {"png",
     {".png", "", ""},
     "8-bit or 16-bit integers",
     {Depth::u8, Depth::u16, Depth::u16, Depth::u16},
     65536,
     "PNG",
     Holds::alpha},
    {"jpeg",
     {".jpg", ".jpeg", ""},
     "8-bit integers",
     {Depth::u8, Depth::u8, Depth::u8, Depth::u8},
     65500,
     "JPEG",
     Holds::alpha},
    {"openexr",
     {".exr", "", ""},
     "half or float",
     {Depth::half, Depth::half, Depth::half, Depth::float32},
     65536,
     "EXR",
     Holds::names},
    {"tiff",
     {".tif", ".tiff", ".tx"},
     "8-bit or 16-bit integers or float",
     {Depth::u8, Depth::u16, Depth::float32, Depth::float32},
     65536,
     "TIFF",
     Holds::data},
}};

const Format* format_by_ending(const std::string& path) {
  std::string lower = path;
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c + 32);
  }
  for (const Format& format : kFormats) {
    for (const std::string_view ending : format.endings) {
      if (!ending.empty() && lower.size() > ending.size() && lower.ends_with(ending))
        return &format;
    }
  }
  return nullptr;
}

/// Renderers read a .tx by what is in it: TIFF has no halves that they all take, so these are EXR,
/// as `maketx --format openexr` has them.
bool is_half_tx(const std::string& path, Depth depth) {
  return depth == Depth::half && is_tx_path(path);
}

const Format& exr_format() { return kFormats[2]; }

const Format* format_of(const std::string& path, Depth depth) {
  return is_half_tx(path, depth) ? &exr_format() : format_by_ending(path);
}

/// Of an encoder itself.
constexpr std::uint64_t kEncoderBaseBytes = 1U << 20;

}  // namespace

bool is_image_path(const std::string& path) { return format_by_ending(path) != nullptr; }

std::string why_not_writable(const std::string& path, const ImageWriteSpec& spec) {
  const Format* format = format_of(path, spec.depth);
  if (format == nullptr) {
    return fmt::format(
        "{}: images are written as .png, .jpg, .jpeg, .tif, .tiff, .tx or .exr; choose one of "
        "these extensions",
        path);
  }
  if (spec.width < 1 || spec.height < 1 || spec.width > format->largest_side ||
      spec.height > format->largest_side) {
    return fmt::format(
        "{}: {} x {} texels are not supported; each side must be 1 to {} in this format", path,
        spec.width, spec.height, format->largest_side);
  }
  const bool is_named = format->channels == Holds::names && spec.names.size() == spec.channels;
  if (spec.channels < 1 || (spec.channels > 4 && !is_named)) {
    return fmt::format("{}: {} channels are not supported; write 1 to 4", path, spec.channels);
  }
  if (std::string_view(format->name) == "jpeg" && spec.has_alpha) {
    return fmt::format("{}: JPEG does not support alpha; choose .png, .tif or .exr", path);
  }
  if (format->channels == Holds::alpha && spec.channels % 2 == 0 && !spec.has_alpha) {
    return fmt::format("{}: {} does not support {} channels without alpha; choose .tif or .exr",
                       path, format->title, spec.channels);
  }
  if (writable_depth(path, spec.depth) != spec.depth) {
    return fmt::format("{}: this format supports {}, not {}", path, format->holds,
                       depth_name(spec.depth));
  }
  return "";
}

std::string why_no_exr_compression(const std::string& name) {
  constexpr std::array<std::string_view, 5> kLossless{"none", "rle", "zips", "zip", "piz"};
  if (std::find(kLossless.begin(), kLossless.end(), name) != kLossless.end()) return "";
  return fmt::format("got \"{}\", expected none, rle, zips, zip or piz, which are lossless", name);
}

bool is_tx_path(const std::string& path) { return lower_ending(path) == ".tx"; }

bool is_exr(const std::string& path, Depth depth) {
  return format_of(path, depth) == &exr_format();
}

FormatLook format_look(const std::string& path, Depth depth) {
  const Format* format = format_of(path, depth);
  if (format == nullptr) return {};
  const bool is_data = format->channels != Holds::alpha;
  return {format->title, is_data, format->channels == Holds::names, is_data};
}

Depth writable_depth(const std::string& path, Depth wanted) {
  const Format* format = format_of(path, wanted);
  return format == nullptr ? wanted : format->depth_for[static_cast<std::size_t>(wanted)];
}

struct ImageWriter::Impl {
  Impl(const std::string& path, const ImageWriteSpec& wanted, BeginWork begin_work,
       EncodedBlocks* known)
      : spec(wanted), file(std::make_unique<OutputFile>(path)) {
    const std::string_view name = format_of(path, spec.depth)->name;
    const bool is_exr = name == "openexr";
    premultiply = spec.has_alpha && (is_exr || spec.layout.mipmap) && !spec.premultiplied;
    const auto to_file = [this](std::span<const std::byte> bytes) {
      std::fwrite(bytes.data(), 1, bytes.size(), file->stream());
      file->check();
    };
    encoder = is_exr           ? encode_exr(*file, spec)
              : name == "tiff" ? encode_tiff(*file, spec)
              : name == "jpeg" ? encode_jpeg(to_file, spec)
                               : encode_png(to_file, spec, std::move(begin_work), known);
  }
  Impl(WriteFile& to, const ImageWriteSpec& wanted, BeginWork begin_work, EncodedBlocks* known)
      : spec(wanted) {
    encoder = encode_png([&to](std::span<const std::byte> bytes) { to.append(bytes); }, spec,
                         std::move(begin_work), known);
  }

  /// The rows go into tiles as soon as a row of these is complete.
  void tile(const std::byte* samples) {
    const std::uint32_t edge = spec.layout.tile_size;
    const std::size_t row_bytes = row_bytes_of(spec);
    tile_rows.resize(row_bytes * edge);
    std::memcpy(tile_rows.data() + next_row % edge * row_bytes, samples, row_bytes);
    if ((next_row + 1) % edge != 0 && next_row + 1 < spec.height) return;
    encoder->write_rows(next_row / edge * edge, next_row % edge + 1, tile_rows.data());
  }

  ImageWriteSpec spec;               // of the level
  std::unique_ptr<OutputFile> file;  // outlives the encoder
  std::unique_ptr<RowEncoder> encoder;
  bool premultiply = false;
  std::uint32_t next_row = 0;         // of the level
  std::vector<std::byte> multiplied;  // rows times alpha
  PageVector<std::byte> tile_rows;    // of a row of tiles
};

ImageWriter::ImageWriter(const std::string& path, const ImageWriteSpec& spec, BeginWork begin_work,
                         EncodedBlocks* known) {
  if (const std::string reason = why_not_writable(path, spec); !reason.empty()) {
    throw Error(ErrorKind::usage, reason);
  }
  impl_ = std::make_unique<Impl>(path, spec, std::move(begin_work), known);
}

ImageWriter::ImageWriter(WriteFile& sink, const ImageWriteSpec& spec, BeginWork begin_work,
                         EncodedBlocks* known) {
  if (const std::string reason = why_not_writable("image.png", spec); !reason.empty()) {
    throw Error(ErrorKind::usage, reason);
  }
  impl_ = std::make_unique<Impl>(sink, spec, std::move(begin_work), known);
}

ImageWriter::~ImageWriter() = default;
ImageWriter::ImageWriter(ImageWriter&&) noexcept = default;
ImageWriter& ImageWriter::operator=(ImageWriter&&) noexcept = default;

void ImageWriter::write_rows(std::uint32_t row_count, const std::byte* rows) {
  Impl& self = *impl_;
  if (row_count > self.spec.height - self.next_row) {
    throw Error(ErrorKind::internal, "more rows written than the image has");
  }
  if (self.premultiply) {
    self.multiplied.assign(rows, rows + row_count * row_bytes_of(self.spec));
    multiply_by_alpha(self.spec.depth, self.spec.channels, std::size_t{self.spec.width} * row_count,
                      self.multiplied.data());
    rows = self.multiplied.data();
  }
  if (self.spec.layout.tile_size == 0) {
    self.encoder->write_rows(self.next_row, row_count, rows);
    self.next_row += row_count;
    return;
  }
  for (std::uint32_t i = 0; i < row_count; ++i, ++self.next_row)
    self.tile(rows + i * row_bytes_of(self.spec));
}

void ImageWriter::next_level() {
  Impl& self = *impl_;
  if (self.next_row != self.spec.height)
    throw Error(ErrorKind::internal, "a MIP level begins before the previous one is complete");
  const ImageSize size = mesh::next_level_size({self.spec.width, self.spec.height});
  self.spec.width = size.width;
  self.spec.height = size.height;
  self.next_row = 0;
  self.encoder->next_level(size.width, size.height);
}

std::unique_ptr<OutputFile> ImageWriter::finish() {
  Impl& self = *impl_;
  if (self.next_row != self.spec.height) {
    throw Error(ErrorKind::internal,
                fmt::format("{} of {} rows written at commit", self.next_row, self.spec.height));
  }
  self.encoder->finish();
  self.encoder.reset();
  if (self.file) self.file->close();
  return std::move(self.file);
}

void ImageWriter::commit() {
  if (const std::unique_ptr<OutputFile> file = finish()) file->commit();
}

std::uint64_t ImageWriter::encoder_bytes(const std::string& path, const ImageWriteSpec& spec) {
  const Format* format = format_of(path, spec.depth);
  const std::string_view name = format == nullptr ? "" : format->name;
  const std::uint64_t row = row_bytes_of(spec);
  if (const std::uint64_t edge = spec.layout.tile_size; edge > 0) {
    // A row of tiles, copies of one on its way, and where each is in the file.
    const std::uint64_t tile = edge * edge * row / spec.width;
    const std::uint64_t tiles = tiled_texels(spec) / (edge * edge);
    return kEncoderBaseBytes + across_tiles(spec) * tile + 6 * tile + 48 * tiles;
  }
  if (name == "openexr") return kEncoderBaseBytes + 16 * 6 * row;
  if (name == "tiff") return kEncoderBaseBytes + 3 * row * strip_rows(spec);
  if (name == "jpeg") return kEncoderBaseBytes + 64 * row;
  return png_encoder_bytes(spec);
}

std::uint64_t ImageWriter::encoded_block_bytes(const std::string& path,
                                               const ImageWriteSpec& spec) {
  const Format* format = format_of(path, spec.depth);
  return format == nullptr || std::string_view(format->name) == "png" ? png_block_bytes(spec) : 0;
}

}  // namespace pounce::io
