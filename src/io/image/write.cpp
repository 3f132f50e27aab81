// SPDX-License-Identifier: Apache-2.0
#include "io/image/write.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include "core/page_pool.h"
#include "io/files/asset_file.h"
#include "io/files/finished_output.h"
#include "io/files/output_file.h"
#include "io/image/colour_tags.h"
#include "io/image/decoder.h"
#include "io/image/output_proxy.h"
#include "io/image/sample.h"
#include "mesh/lattice.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// What a second or fourth channel may be: alpha, or also data, which may have a name.
enum class Holds { alpha, data, names };

struct Format {
  const char* name;  // OpenImageIO's
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

// Deflating a 2048^2 photograph as PNG, ns and bytes per texel: level 6 with libpng's choice of
// filters 175 and 0.46, level 3 67 and 0.52, level 2 57 and 0.56; with the Up filter alone level 3
// 43 and 0.48, level 2 30 and 0.55, level 1 28 and 0.59. A checkerboard costs 7. Projection costs
// tens of ns: level 2 does not hold it up. The same level in TIFF 47 (6: 240), in half EXR 70 (6:
// 306).
constexpr int kDeflateLevel = 2;
constexpr int kPngFilter = 32;  // PNG_FILTER_UP

OIIO::TypeDesc type_of(Depth depth) {
  constexpr std::array kTypes{OIIO::TypeDesc::UINT8, OIIO::TypeDesc::UINT16, OIIO::TypeDesc::HALF,
                              OIIO::TypeDesc::FLOAT};
  return kTypes[static_cast<std::size_t>(depth)];
}

std::uint64_t row_bytes_of(const ImageWriteSpec& spec) {
  return std::uint64_t{spec.width} * spec.channels * type_of(spec.depth).size();
}

/// Rows of a TIFF strip: 64 KiB or a row.
std::uint32_t strip_rows(const ImageWriteSpec& spec) {
  const std::uint64_t rows = (64U << 10) / std::max<std::uint64_t>(1, row_bytes_of(spec));
  return static_cast<std::uint32_t>(std::clamp<std::uint64_t>(rows, 1, spec.height));
}

std::uint32_t across_tiles(const ImageWriteSpec& spec) {
  return (spec.width + spec.layout.tile_size - 1) / spec.layout.tile_size;
}

/// Texels of all tiles of an image, its levels included.
std::uint64_t tiled_texels(const ImageWriteSpec& spec) {
  const std::uint64_t edge = spec.layout.tile_size;
  std::uint64_t tiles = 0;
  for (ImageSize size{spec.width, spec.height};; size = mesh::next_level_size(size)) {
    tiles += ((size.width + edge - 1) / edge) * ((size.height + edge - 1) / edge);
    if (!spec.layout.mipmap || size == ImageSize{1, 1}) return tiles * edge * edge;
  }
}

// A classic TIFF ends at 4 GiB. OpenImageIO looks at a level without the others when it decides.
constexpr std::uint64_t kMostClassicBytes = 4000ULL << 20;

/// The attributes are those of maketx, less what OpenImageIO believes of no other program (mean and
/// constant colour, hash of the samples). Readers take the last level for the mean.
void add_tiles(const ImageWriteSpec& spec, OIIO::ImageSpec& out) {
  out.tile_width = out.tile_height = static_cast<int>(spec.layout.tile_size);
  out.tile_depth = 1;
  if (tiled_texels(spec) * spec.channels * type_of(spec.depth).size() > kMostClassicBytes)
    out.attribute("tiff:bigtiff", 1);
  if (!spec.layout.mipmap) return;
  out.attribute("textureformat", "Plain Texture");
  out.attribute("wrapmodes", "black,black");
  out.attribute("fovcot", static_cast<float>(spec.width) / static_cast<float>(spec.height));
}

OIIO::ImageSpec oiio_spec(const Format& format, const ImageWriteSpec& spec) {
  const std::string_view name = format.name;
  OIIO::ImageSpec out(static_cast<int>(spec.width), static_cast<int>(spec.height),
                      static_cast<int>(spec.channels), type_of(spec.depth));
  out.channelnames = spec.names.empty() || name != "openexr"
                         ? usual_names(spec.channels, spec.has_alpha)
                         : spec.names;
  out.alpha_channel = spec.has_alpha ? static_cast<int>(spec.channels) - 1 : -1;
  if (spec.chromaticities && name == "openexr") {
    out.attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8),
                  spec.chromaticities->data());
  }
  if (out.alpha_channel >= 0 && name != "openexr" && !spec.layout.mipmap)
    out.attribute("oiio:UnassociatedAlpha", 1);
  if (spec.chromaticities && name != "openexr") {
    const std::vector<std::byte> profile = make_icc({*spec.chromaticities, spec.linear});
    out.attribute("ICCProfile",
                  OIIO::TypeDesc(OIIO::TypeDesc::UINT8, static_cast<int>(profile.size())),
                  profile.data());
  }
  // Beside a profile a second word on the same is one too many. In a TIFF this would only add an
  // Exif directory, for which libtiff reads the main one back.
  if (spec.tagged && (name == "openexr" || (name != "tiff" && !spec.chromaticities)))
    out.attribute("oiio:ColorSpace", spec.linear || name == "openexr" ? "linear" : "sRGB");
  out.attribute("DateTime", "");  // else TIFF and EXR are given the time of day
  out.attribute("Software", software_name());
  if (!spec.job.empty()) out.attribute("ImageDescription", job_description(spec.job));
  if (!spec.hits_note.empty()) out.attribute(kHitsAttribute, spec.hits_note);
  if (name == "png") {
    out.attribute("png:compressionLevel", static_cast<int>(spec.layout.png_compression));
    out.attribute("png:filter", kPngFilter);
  } else if (name == "jpeg") {
    out.attribute("Compression", fmt::format("jpeg:{}", spec.layout.jpeg_quality));
    out.attribute("jpeg:subsampling", "4:4:4");
  } else if (name == "tiff") {
    out.attribute("compression", "zip");
    out.attribute("tiff:zipquality", kDeflateLevel);
    out.attribute("tiff:RowsPerStrip", static_cast<int>(strip_rows(spec)));
  } else {
    const std::string& compression = spec.layout.exr_compression;
    const bool zip = compression.empty() || compression == "zip";
    out.attribute("compression", zip ? fmt::format("zip:{}", kDeflateLevel) : compression);
  }
  if (spec.layout.tile_size > 0) add_tiles(spec, out);
  return out;
}

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
  Impl(const std::string& path, const ImageWriteSpec& wanted)
      : spec(wanted), file(std::in_place, path) {
    auto to_file = std::make_unique<OutputProxy>(*file);
    file_proxy = to_file.get();
    open(*format_of(path, spec.depth), path, std::move(to_file));
  }
  Impl(WriteFile& to, const ImageWriteSpec& wanted) : spec(wanted) {
    auto to_sink = std::make_unique<SinkProxy>(to);
    sink = to_sink.get();
    open(kFormats.front(), "image.png", std::move(to_sink));
  }

  ~Impl() {
    // An encoder that is closed early complains about missing rows; nobody wants to know. libpng
    // says so on the standard error output, unless it has put out something.
    if (output && next_row < spec.height && std::string_view(output->format_name()) == "png")
      write_noise();
    if (output) output->close();
    if (output) output->geterror();
  }

  void open(const Format& format, const std::string& path,
            std::unique_ptr<OIIO::Filesystem::IOProxy> to) {
    set_up_oiio();
    proxy = std::move(to);
    output = OIIO::ImageOutput::create(format.name);
    if (!output) fail(fmt::format("OpenImageIO was built without support for {}", format.name));
    output->threads(1);
    foreign = oiio_spec(format, spec);
    OIIO::Filesystem::IOProxy* io = proxy.get();
    foreign.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &io);
    const bool times_alpha = std::string_view(format.name) == "openexr" || spec.layout.mipmap;
    premultiply = foreign.alpha_channel >= 0 && times_alpha && !spec.premultiplied;
    if (!output->open(path, foreign)) fail();
    name = path;
  }

  /// Of the size that `spec` has now.
  void open_level() {
    foreign.width = foreign.full_width = static_cast<int>(spec.width);
    foreign.height = foreign.full_height = static_cast<int>(spec.height);
    auto mode = OIIO::ImageOutput::AppendMIPLevel;
    if (output->supports("mipmap") == 0) {  // TIFF: images, one after another
      close();
      file_proxy->append_tiff_image();
      mode = OIIO::ImageOutput::Create;
      foreign.extra_attribs.remove("ImageDescription");  // the first one's are all that is read
      foreign.extra_attribs.remove("ICCProfile");
    }
    if (!output->open(name, foreign, mode)) fail();
  }

  void close() {
    if (!output->close()) fail();
    if (file) proxy->flush();
    check();
  }

  /// The rows go into tiles as soon as a row of these is complete.
  void tile(const std::byte* samples) {
    const std::uint32_t edge = spec.layout.tile_size;
    const std::size_t texel_bytes = row_bytes_of(spec) / spec.width;
    const std::size_t stride = across_tiles(spec) * edge * texel_bytes;
    tile_rows.resize(stride * edge);
    // What a tile has beyond the image is in the file, too.
    if (next_row % edge == 0) std::fill(tile_rows.begin(), tile_rows.end(), std::byte{});
    std::memcpy(tile_rows.data() + next_row % edge * stride, samples, row_bytes_of(spec));
    if ((next_row + 1) % edge != 0 && next_row + 1 < spec.height) return;
    const auto y = static_cast<int>(next_row / edge * edge);
    for (std::uint32_t x = 0; x < spec.width; x += edge) {
      if (!output->write_tile(static_cast<int>(x), y, 0, type_of(spec.depth),
                              tile_rows.data() + x * texel_bytes, OIIO::AutoStride,
                              static_cast<OIIO::stride_t>(stride))) {
        fail();
      }
    }
  }

  /// Rows that do not deflate, enough to make the encoder put some out.
  void write_noise() {
    constexpr std::size_t kEnough = 512 << 10;
    std::vector<std::byte> noise(row_bytes_of(spec));
    std::uint32_t state = 1;
    for (std::size_t done = 0; done < kEnough && next_row < spec.height; done += noise.size()) {
      for (std::byte& b : noise)
        b = static_cast<std::byte>((state = state * 1664525 + 1013904223) >> 24);
      const int y = static_cast<int>(next_row++);
      if (!output->write_scanline(y, 0, type_of(spec.depth), noise.data())) return;
    }
  }

  /// Throws if any byte so far did not reach the file.
  void check() const {
    if (file) file->check();
    if (sink != nullptr) sink->check();
  }

  [[noreturn]] void fail() {
    const std::string message = one_line(output->geterror());
    fail(message.empty() ? "the encoder reported no reason" : message);
  }
  [[noreturn]] void fail(const std::string& what) const {
    check();
    if (file) file->fail(what);
    throw Error(ErrorKind::storage, fmt::format("cannot encode an image: {}", what));
  }

  ImageWriteSpec spec;
  std::optional<OutputFile> file;  // outlives the proxy and the encoder
  std::unique_ptr<OIIO::Filesystem::IOProxy> proxy;
  OutputProxy* file_proxy = nullptr;  // it, where there is a file
  SinkProxy* sink = nullptr;          // it, where there is none
  std::unique_ptr<OIIO::ImageOutput> output;
  OIIO::ImageSpec foreign;  // what the encoder was told
  bool premultiply = false;
  std::string name;                 // of the image, for its levels
  std::uint32_t next_row = 0;       // of the level
  std::vector<std::byte> row;       // premultiplied copy of one row
  PageVector<std::byte> tile_rows;  // of a row of tiles, these whole
};

ImageWriter::ImageWriter(const std::string& path, const ImageWriteSpec& spec) {
  if (const std::string reason = why_not_writable(path, spec); !reason.empty()) {
    throw Error(ErrorKind::usage, reason);
  }
  impl_ = std::make_unique<Impl>(path, spec);
}

ImageWriter::ImageWriter(WriteFile& sink, const ImageWriteSpec& spec) {
  if (const std::string reason = why_not_writable("image.png", spec); !reason.empty()) {
    throw Error(ErrorKind::usage, reason);
  }
  impl_ = std::make_unique<Impl>(sink, spec);
}

ImageWriter::~ImageWriter() = default;
ImageWriter::ImageWriter(ImageWriter&&) noexcept = default;
ImageWriter& ImageWriter::operator=(ImageWriter&&) noexcept = default;

void ImageWriter::write_rows(std::uint32_t row_count, const std::byte* rows) {
  Impl& self = *impl_;
  if (row_count > self.spec.height - self.next_row) {
    throw Error(ErrorKind::internal, "more rows written than the image has");
  }
  const std::size_t row_bytes = row_bytes_of(self.spec);
  for (std::uint32_t i = 0; i < row_count; ++i, ++self.next_row, rows += row_bytes) {
    const std::byte* samples = rows;
    if (self.premultiply) {
      self.row.assign(rows, rows + row_bytes);
      multiply_by_alpha(self.spec.depth, self.spec.channels, self.spec.width, self.row.data());
      samples = self.row.data();
    }
    if (self.spec.layout.tile_size > 0) {
      self.tile(samples);
    } else if (!self.output->write_scanline(static_cast<int>(self.next_row), 0,
                                            type_of(self.spec.depth), samples)) {
      self.fail();
    }
  }
  self.check();
}

void ImageWriter::next_level() {
  Impl& self = *impl_;
  if (self.next_row != self.spec.height)
    throw Error(ErrorKind::internal, "a MIP level begins before the previous one is complete");
  const ImageSize size = mesh::next_level_size({self.spec.width, self.spec.height});
  self.spec.width = size.width;
  self.spec.height = size.height;
  self.next_row = 0;
  self.open_level();
}

void ImageWriter::commit() {
  Impl& self = *impl_;
  if (self.next_row != self.spec.height) {
    throw Error(ErrorKind::internal,
                fmt::format("{} of {} rows written at commit", self.next_row, self.spec.height));
  }
  self.close();
  self.output.reset();
  self.sink = nullptr;
  self.file_proxy = nullptr;
  self.proxy.reset();
  if (self.file) self.file->commit();
}

std::uint64_t ImageWriter::encoder_bytes(const std::string& path, const ImageWriteSpec& spec) {
  const Format* format = format_of(path, spec.depth);
  const std::string_view name = format == nullptr ? "" : format->name;
  const std::uint64_t row = row_bytes_of(spec);
  constexpr std::uint64_t kBase = 1U << 20;
  if (const std::uint64_t edge = spec.layout.tile_size; edge > 0) {
    // A row of tiles, copies of one on its way, and where each is in the file.
    const std::uint64_t tile = edge * edge * row / spec.width;
    const std::uint64_t tiles = tiled_texels(spec) / (edge * edge);
    return kBase + across_tiles(spec) * tile + 6 * tile + 48 * tiles;
  }
  if (name == "openexr") return kBase + 16 * 6 * row;
  if (name == "tiff") return kBase + 3 * row * strip_rows(spec);
  if (name == "jpeg") return kBase + 64 * row;
  return kBase + 8 * row;
}

}  // namespace pounce::io
