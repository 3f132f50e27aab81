// SPDX-License-Identifier: Apache-2.0
//
// OpenImageIO decodes what few people have. It is given the bytes as a C stream over a range of a
// file or over memory, which each of these formats accepts, and is asked for samples as stored. It
// takes whole BMPs with run lengths into memory when it opens them, so that waits for the first
// row; and looks beyond the end of short palettes and texts of a Targa, so these are not shown.
#include "io/foreign/oiio_decoder.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <mutex>
#include <optional>
#include <vector>

#include "io/codec/guard.h"
#include "io/codec/sample.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// Tells OpenImageIO once what it cannot be told per file.
void set_up_oiio() {
  static std::once_flag once;
  std::call_once(once, [] {
    // What nobody asked for it would put on the standard error output, between lines of ours.
    OIIO::attribute("oiio:print_uncaught_errors", 0);
    OIIO::attribute("limits:imagesize_MB", 0);  // no limit: we never allocate by what a header says
  });
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

/// A BMP with run lengths, if it is one: three channels, always.
std::optional<BmpHeader> bmp_runs(ByteSource& bytes) {
  const std::optional<BmpHeader> header = bmp_header(bytes);
  bytes.check();
  if (!header || !header->has_runs()) return std::nullopt;
  // For other bits the decoder has no palette, and looks into it.
  if (header->bits != (header->compression == 1 ? 8U : 4U))
    refuse_damaged(bytes.label(), "the image header cannot be read", "");
  constexpr std::int64_t kMostTexels = INT32_MAX;  // it counts them in int
  if (header->width > 0 && header->height > kMostTexels / header->width) {
    throw Error(
        ErrorKind::input,
        fmt::format(
            "{}: a run-length encoded BMP of {} x {} texels is too large; convert it to PNG",
            bytes.label(), header->width, header->height));
  }
  return header;
}

/// The stream for everybody. IOFile's own pread() and size() want a file descriptor, which a stream
/// over a part of a file has not.
class SourceProxy : public OIIO::Filesystem::IOFile {
 public:
  SourceProxy(ByteSource& bytes, FILE* stream) : IOFile(stream, Read), bytes_(bytes) {}
  std::size_t pread(void* out, std::size_t count, std::int64_t offset) override {
    return offset < 0 ? 0 : bytes_.read_at(static_cast<std::uint64_t>(offset), out, count);
  }
  std::size_t size() const override { return static_cast<std::size_t>(bytes_.size_bytes()); }

 private:
  ByteSource& bytes_;
};

class OiioDecoder : public RowDecoder {
 public:
  OiioDecoder(ByteSource& bytes, ImageInfo& info);
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) override;

 private:
  void open();
  ImageInfo described() const;
  [[noreturn]] void fail(const std::string& what);

  ByteSource& bytes_;
  bool has_runs_ = false;
  ImageInfo promised_;
  std::unique_ptr<FILE, int (*)(FILE*)> stream_{nullptr, std::fclose};  // outlives what follows
  std::unique_ptr<SourceProxy> proxy_;
  std::unique_ptr<OIIO::ImageInput> input_;
};

OiioDecoder::OiioDecoder(ByteSource& bytes, ImageInfo& info) : bytes_(bytes) {
  promised_.format = info.format;
  if (info.format == "targa") hide_in_targa(bytes);
  const auto runs = info.format == "bmp" ? bmp_runs(bytes) : std::nullopt;
  if (runs) {
    has_runs_ = true;
    check_size(bytes.label(), runs->width, runs->height);
    promised_.width = static_cast<std::uint32_t>(runs->width);
    promised_.height = static_cast<std::uint32_t>(runs->height);
    promised_.channels = 3;
    promised_.names = usual_names(3, false);
  } else {
    open();
    promised_ = described();
  }
  const std::uint64_t row =
      std::uint64_t{promised_.width} * promised_.channels * sample_bytes(promised_.depth);
  promised_.decoder_bytes = kDecoderBaseBytes + 4 * row;
  if (info.format != "hdr") promised_.decoder_bytes += row * promised_.height + bytes.size_bytes();
  info = promised_;
}

void OiioDecoder::open() {
  set_up_oiio();
  stream_.reset(bytes_.stream());
  proxy_ = std::make_unique<SourceProxy>(bytes_, stream_.get());
  auto created = OIIO::ImageInput::create(promised_.format);
  if (!created) {
    throw Error(ErrorKind::input, fmt::format("{}: OpenImageIO was built without support for {}",
                                              bytes_.label(), promised_.format));
  }
  created->threads(1);
  OIIO::ImageSpec config, spec;
  config.attribute("oiio:UnassociatedAlpha", 1);
  // A BMP with run lengths and a grey palette is said to have one channel, and three are written.
  if (has_runs_) config.attribute("bmp:monochrome_detect", 0);
  OIIO::Filesystem::IOProxy* io = proxy_.get();
  config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &io);
  const bool opened = created->open(bytes_.label(), spec, config);
  input_ = std::move(created);
  if (!opened || input_->has_error()) fail("the image header cannot be read");
}

ImageInfo OiioDecoder::described() const {
  const OIIO::ImageSpec& spec = input_->spec();
  check_size(bytes_.label(), spec.width, spec.height);
  ImageInfo info;
  info.format = promised_.format;
  info.width = static_cast<std::uint32_t>(spec.width);
  info.height = static_cast<std::uint32_t>(spec.height);
  const ChosenChannels chosen = choose_channels(spec.channelnames, spec.alpha_channel);
  const bool is_plain = spec.channelformats.empty() && spec.nchannels >= 1 &&
                        chosen.places.size() == static_cast<std::size_t>(spec.nchannels);
  const bool is_float = spec.format == OIIO::TypeDesc::FLOAT;
  if (!is_plain || spec.tile_width > 0 || (!is_float && spec.format != OIIO::TypeDesc::UINT8)) {
    throw Error(
        ErrorKind::input,
        fmt::format("{}: {} channels of type {} are not supported; convert it to PNG or EXR",
                    bytes_.label(), spec.nchannels, spec.format.c_str()));
  }
  info.channels = static_cast<std::uint32_t>(spec.nchannels);
  info.depth = is_float ? Depth::float32 : Depth::u8;
  info.linear = is_float;
  info.has_alpha = chosen.has_alpha;
  // Of these formats only a Targa can say that.
  info.premultiplied = info.has_alpha && info.format == "targa" &&
                       spec.get_int_attribute("oiio:UnassociatedAlpha") == 0;
  info.names = chosen.names;
  return info;
}

void OiioDecoder::read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) {
  if (!input_) {
    open();
    const ImageInfo found = described();
    if (found.width != promised_.width || found.height != promised_.height ||
        found.channels != promised_.channels || found.depth != promised_.depth) {
      fail("the decoded size or format differs from the image header");
    }
  }
  const std::size_t row_bytes =
      std::size_t{promised_.width} * promised_.channels * sample_bytes(promised_.depth);
  for (std::uint32_t i = 0; i < count; ++i) {
    const int row = static_cast<int>(first + i);
    if (!input_->read_scanline(row, 0, OIIO::TypeDesc::UNKNOWN, rows + i * row_bytes))
      fail(fmt::format("decoding failed in row {} of {}", row, promised_.height));
  }
  // Decoders that go on after damage leave a text behind.
  if (input_->has_error()) {
    fail(fmt::format("the image is damaged in rows {} to {} of {}", first, first + count - 1,
                     promised_.height));
  }
}

void OiioDecoder::fail(const std::string& what) {
  decoder_failed(bytes_, what, input_ ? one_line(input_->geterror()) : "", promised_.decoder_bytes);
}

}  // namespace

std::unique_ptr<RowDecoder> open_by_oiio(ByteSource& bytes, ImageInfo& info) {
  return std::make_unique<OiioDecoder>(bytes, info);
}

}  // namespace pounce::io
