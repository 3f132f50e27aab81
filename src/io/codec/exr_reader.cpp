// SPDX-License-Identifier: Apache-2.0
//
// EXR by OpenEXR, behind guard_exr(). What is compressed together (a block of rows, a row of tiles)
// is decoded together and handed out by rows. The picture is the display window: what the data
// window has beyond it is left out, what it lacks is 0.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfChromaticitiesAttribute.h>
#include <OpenEXR/ImfCompressionAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfTileDescriptionAttribute.h>
#include <OpenEXR/ImfTiledInputPart.h>
#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "core/page_pool.h"
#include "io/codec/guard.h"
#include "io/codec/row_decoder.h"
#include "io/codec/sample.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

using Imath::Box2i;

class SourceStream : public Imf::IStream {
 public:
  explicit SourceStream(ByteSource& bytes) : IStream(bytes.label().c_str()), bytes_(bytes) {}
  bool read(char* out, int count) override {
    const auto wanted = static_cast<std::size_t>(std::max(count, 0));
    const std::size_t got = bytes_.read_at(position_, out, wanted);
    position_ += got;
    if (got != wanted) throw std::runtime_error("the file ends too early");
    return position_ < bytes_.size_bytes();
  }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t to) override { position_ = to; }

 private:
  ByteSource& bytes_;
  std::uint64_t position_ = 0;
};

/// A channel of a part.
struct ExrChannel {
  std::string name;
  Imf::PixelType type = Imf::HALF;

  std::string_view layer() const { return std::string_view(name).substr(0, suffix_begin()); }
  const char* suffix() const { return name.c_str() + suffix_begin(); }
  bool is(const char* what) const { return strcasecmp(suffix(), what) == 0; }

 private:
  std::size_t suffix_begin() const { return name.rfind('.') + 1; }  // npos + 1 is 0
};

/// The place that a channel's usual name has among those of its layer; others follow as they come.
/// `beside_x`: Z is the third of X, Y, Z there, else a depth.
int usual_place(const ExrChannel& channel, bool beside_x) {
  constexpr std::array kUsual{"R",  "Red",  "G",    "Green", "B",     "Blue", "X",  "Y",
                              "Z",  "real", "imag", "A",     "Alpha", "AR",   "RA", "AG",
                              "GA", "AB",   "BA",   "Z",     "Depth", "Zback"};
  const auto from = beside_x || !channel.is("Z") ? kUsual.begin() : kUsual.end() - 3;
  const auto at =
      std::find_if(from, kUsual.end(), [&](const char* name) { return channel.is(name); });
  return static_cast<int>(at - kUsual.begin());
}

/// Of a part, layer by layer, colours first and alpha behind them: a file has them by alphabet.
std::vector<ExrChannel> channels_of(const Imf::Header& header) {
  std::vector<ExrChannel> channels;
  for (auto at = header.channels().begin(); at != header.channels().end(); ++at)
    channels.push_back({at.name(), at.channel().type});
  std::set<std::string> with_x;  // layers
  for (const ExrChannel& channel : channels) {
    if (channel.is("X")) with_x.emplace(channel.layer());
  }
  const auto place = [&](const ExrChannel& channel) {
    const bool beside_x = with_x.count(std::string(channel.layer())) > 0;
    return std::tuple(channel.layer(), usual_place(channel, beside_x));
  };
  std::stable_sort(channels.begin(), channels.end(),
                   [&](const ExrChannel& a, const ExrChannel& b) { return place(a) < place(b); });
  return channels;
}

std::vector<std::string> names_of(const std::vector<ExrChannel>& channels) {
  std::vector<std::string> names;
  for (const ExrChannel& channel : channels) names.push_back(channel.name);
  return names;
}

std::vector<Part> parts_of(const Imf::MultiPartInputFile& file) {
  constexpr int kMostParts = 1024;
  std::vector<Part> parts;
  for (int i = 0; i < std::min(file.parts(), kMostParts); ++i) {
    const Imf::Header& header = file.header(i);
    parts.push_back({header.hasName() ? header.name() : "", names_of(channels_of(header))});
  }
  if (file.parts() == 1) parts.front().name.clear();
  return parts;
}

std::vector<std::string> full_names(std::span<const Part> parts) {
  std::vector<std::string> names;
  for (const Part& part : parts) {
    const std::vector<std::string> own = part.full_names();
    names.insert(names.end(), own.begin(), own.end());
  }
  return names;
}

/// A file that is open.
struct ExrFile {
  explicit ExrFile(ByteSource& of) : bytes(of), parts_bytes(guard_exr(of)), stream(of) {
    try {
      file.emplace(stream, 0);
    } catch (const std::exception& e) {
      decoder_failed(bytes, "the image header cannot be read", one_line(e.what()), parts_bytes);
    }
  }

  ByteSource& bytes;
  std::uint64_t parts_bytes;  ///< memory that opening it took
  SourceStream stream;
  std::optional<Imf::MultiPartInputFile> file;
};

/// Which channels of which part make the image.
ChosenPart choose(const ExrFile& exr, const WantedChannels& wanted) {
  const std::string& label = exr.bytes.label();
  const std::vector<Part> parts = parts_of(*exr.file);
  if (!wanted.named.empty()) {
    ChosenPart chosen = named_channels(parts, wanted.named);
    if (!chosen.channels.places.empty()) return chosen;
    throw Error(ErrorKind::input,
                fmt::format("{}: \"{}\" names neither a layer nor 1 to {} different channels of "
                            "this file; it has {}",
                            label, wanted.named, kMostChannels, joined(full_names(parts))));
  }
  const std::vector<ExrChannel> channels = channels_of(exr.file->header(0));
  const std::vector<std::string> names = names_of(channels);
  ChosenPart chosen;
  if (wanted.data.empty()) {
    const auto alpha = std::find_if(
        channels.begin(), channels.end(),
        [](const ExrChannel& channel) { return channel.is("A") || channel.is("Alpha"); });
    chosen.channels = choose_channels(
        names, alpha == channels.end() ? -1 : static_cast<int>(alpha - channels.begin()));
    if (chosen.channels.places.empty()) throw too_many_channels(label, names);
    const std::vector<std::string> others = full_names(std::span(parts).subspan(1));
    std::vector<std::string>& left_out = chosen.channels.left_out;
    left_out.insert(left_out.end(), others.begin(), others.end());
    return chosen;
  }
  chosen.channels.names = wanted.data;
  for (const std::string& name : wanted.data) {
    const auto at = std::find(names.begin(), names.end(), name);
    if (at == names.end())
      throw Error(ErrorKind::input,
                  fmt::format("{}: the image has no channel \"{}\"", label, name));
    chosen.channels.places.push_back(static_cast<int>(at - names.begin()));
  }
  return chosen;
}

/// Float samples that no compression has changed.
void require_exact(const std::string& label, const Imf::Header& header,
                   const std::vector<ExrChannel>& channels) {
  for (const ExrChannel& channel : channels) {
    if (channel.type == Imf::FLOAT) continue;
    throw Error(
        ErrorKind::input,
        fmt::format("{}: channel \"{}\" is not float, so it is not exact; write it as float", label,
                    channel.name));
  }
  constexpr std::array<std::pair<Imf::Compression, const char*>, 5> kLossy{
      {{Imf::PXR24_COMPRESSION, "pxr24"},
       {Imf::B44_COMPRESSION, "b44"},
       {Imf::B44A_COMPRESSION, "b44a"},
       {Imf::DWAA_COMPRESSION, "dwaa"},
       {Imf::DWAB_COMPRESSION, "dwab"}}};
  for (const auto& [compression, name] : kLossy) {
    if (header.compression() != compression) continue;
    throw Error(ErrorKind::input,
                fmt::format("{}: {} compression loses precision; write it as zip", label, name));
  }
}

/// The deepest of the channels' samples.
Depth depth_of(const std::string& label, const std::vector<ExrChannel>& channels) {
  Depth depth = Depth::half;
  for (const ExrChannel& channel : channels) {
    if (channel.type == Imf::FLOAT) depth = Depth::float32;
    if (channel.type != Imf::FLOAT && channel.type != Imf::HALF) {
      throw Error(
          ErrorKind::input,
          fmt::format("{}: samples of type uint are not supported; convert it to 8-bit or 16-bit "
                      "integers, half or float",
                      label));
    }
  }
  return depth;
}

/// Rows that are compressed together.
int block_rows(Imf::Compression compression) {
  switch (compression) {
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 16;
    case Imf::PIZ_COMPRESSION:
    case Imf::B44_COMPRESSION:
    case Imf::B44A_COMPRESSION:
    case Imf::DWAA_COMPRESSION:
      return 32;
    case Imf::DWAB_COMPRESSION:
      return 256;
    default:
      return 1;
  }
}

std::uint64_t span_of(int least, int most) {
  return static_cast<std::uint64_t>(std::int64_t{most} - least + 1);
}

/// What the header says beside the channels.
void take_attributes(const Imf::Header& header, ImageInfo& info) {
  if (const auto* const note = header.findTypedAttribute<Imf::StringAttribute>(kHitsAttribute))
    info.hits_note = note->value();
  if (!Imf::hasChromaticities(header)) return;
  const Imf::Chromaticities& said = Imf::chromaticities(header);
  const Chromaticities primaries{said.red.x,  said.red.y,  said.green.x, said.green.y,
                                 said.blue.x, said.blue.y, said.white.x, said.white.y};
  if (are_primaries(primaries)) {
    info.colours.primaries = primaries;
  } else {
    info.colours.problem = "its chromaticities are invalid: they enclose no colours";
  }
}

class ExrDecoder : public RowDecoder {
 public:
  ExrDecoder(ByteSource& bytes, const WantedChannels& wanted, ImageInfo& info);
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) override;

 private:
  void take_size(const Imf::Header& header, ImageInfo& info);
  void count_memory(const Imf::Header& header, ImageInfo& info);
  void open_part(ImageInfo& info);
  void decode_block(int row);

  ExrFile exr_;
  int part_ = 0;
  Box2i data_, display_;
  std::vector<ExrChannel> channels_;  ///< the image's
  Imf::PixelType type_ = Imf::HALF;
  std::size_t texel_bytes_ = 0;
  bool tiled_ = false;
  int rows_together_ = 1;
  std::uint64_t decoder_bytes_ = 0;
  std::optional<Imf::InputPart> scanlines_;
  std::optional<Imf::TiledInputPart> tiles_;
  PageVector<std::byte> block_;  ///< of the data window, the image's channels
  int block_first_ = 0, block_count_ = 0;
};

ExrDecoder::ExrDecoder(ByteSource& bytes, const WantedChannels& wanted, ImageInfo& info)
    : exr_(bytes) {
  const ChosenPart chosen = choose(exr_, wanted);
  part_ = static_cast<int>(chosen.part);
  const Imf::Header& header = exr_.file->header(part_);
  const std::vector<ExrChannel> all = channels_of(header);
  for (const int place : chosen.channels.places)
    channels_.push_back(all[static_cast<std::size_t>(place)]);
  if (header.hasType() && Imf::isDeepData(header.type())) {
    throw Error(
        ErrorKind::input,
        bytes.label() + ": deep and volume images are not supported; convert it to a flat image");
  }
  if (!wanted.data.empty()) require_exact(bytes.label(), header, channels_);
  info.channels = static_cast<std::uint32_t>(channels_.size());
  info.has_alpha = info.premultiplied = chosen.channels.has_alpha;
  info.names = chosen.channels.names;
  info.left_out = chosen.channels.left_out;
  info.depth = depth_of(bytes.label(), channels_);
  info.linear = true;
  type_ = info.depth == Depth::half ? Imf::HALF : Imf::FLOAT;
  take_size(header, info);
  take_attributes(header, info);
  texel_bytes_ = sample_bytes(info.depth) * info.channels;
  count_memory(header, info);
  open_part(info);
}

void ExrDecoder::take_size(const Imf::Header& header, ImageInfo& info) {
  data_ = header.dataWindow();
  display_ = header.displayWindow();
  const std::string& label = exr_.bytes.label();
  for (const Box2i& window : {data_, display_}) {
    check_size(label, std::int64_t{window.max.x} - window.min.x + 1,
               std::int64_t{window.max.y} - window.min.y + 1);
  }
  info.width = static_cast<std::uint32_t>(span_of(display_.min.x, display_.max.x));
  info.height = static_cast<std::uint32_t>(span_of(display_.min.y, display_.max.y));
}

void ExrDecoder::count_memory(const Imf::Header& header, ImageInfo& info) {
  std::uint64_t file_texel = 0;
  for (auto at = header.channels().begin(); at != header.channels().end(); ++at)
    file_texel += at.channel().type == Imf::HALF ? 2 : 4;
  const std::uint64_t width = span_of(data_.min.x, data_.max.x);
  // By what the part is, not by what it describes: rows may bring a description of tiles, too.
  tiled_ = header.hasTileDescription() && (!header.hasType() || Imf::isTiled(header.type()));
  if (tiled_) {
    const Imf::TileDescription& tiles = header.tileDescription();
    info.tile_width = tiles.xSize;
    info.tile_height = tiles.ySize;
    rows_together_ = static_cast<int>(tiles.ySize);
    // OpenEXR holds a tile, packed and unpacked.
    info.decoder_bytes =
        kDecoderBaseBytes + 4 * std::uint64_t{tiles.xSize} * tiles.ySize * file_texel;
  } else {
    rows_together_ = block_rows(header.compression());
    info.decoder_bytes =
        kDecoderBaseBytes + 6 * width * file_texel * static_cast<std::uint64_t>(rows_together_);
  }
  info.decoder_bytes +=
      exr_.parts_bytes + width * texel_bytes_ * static_cast<std::uint64_t>(rows_together_);
  decoder_bytes_ = info.decoder_bytes;
}

void ExrDecoder::open_part(ImageInfo& info) {
  try {
    if (tiled_) {
      tiles_.emplace(*exr_.file, part_);
      info.levels = static_cast<std::uint32_t>(tiles_->numXLevels());
    } else {
      scanlines_.emplace(*exr_.file, part_);
    }
  } catch (const std::exception& e) {
    decoder_failed(exr_.bytes, "the header of one of its parts cannot be read", one_line(e.what()),
                   decoder_bytes_);
  }
}

/// What is compressed together with a row of the data window.
void ExrDecoder::decode_block(int row) {
  block_first_ = row - (row - data_.min.y) % rows_together_;
  block_count_ = std::min(rows_together_, data_.max.y - block_first_ + 1);
  const std::size_t stride = span_of(data_.min.x, data_.max.x) * texel_bytes_;
  // Whatever a decoder leaves out is the same in every run.
  block_.assign(stride * static_cast<std::size_t>(block_count_), std::byte{});
  const std::size_t size = texel_bytes_ / channels_.size();
  Imf::FrameBuffer frame;
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    const Imath::V2i origin(data_.min.x, block_first_);
    frame.insert(channels_[c].name,
                 Imf::Slice::Make(type_, block_.data() + c * size, origin,
                                  static_cast<std::int64_t>(span_of(data_.min.x, data_.max.x)),
                                  block_count_, texel_bytes_, stride));
  }
  try {
    if (tiles_) {
      tiles_->setFrameBuffer(frame);
      const int tile_row = (block_first_ - data_.min.y) / rows_together_;
      tiles_->readTiles(0, tiles_->numXTiles(0) - 1, tile_row, tile_row, 0, 0);
    } else {
      scanlines_->setFrameBuffer(frame);
      scanlines_->readPixels(block_first_, block_first_ + block_count_ - 1);
    }
  } catch (const std::exception& e) {
    const int first = block_first_ - display_.min.y;
    decoder_failed(exr_.bytes,
                   fmt::format("decoding failed in rows {} to {} of {}", first,
                               first + block_count_ - 1, span_of(display_.min.y, display_.max.y)),
                   one_line(e.what()), decoder_bytes_);
  }
}

void ExrDecoder::read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) {
  const std::size_t row_bytes = span_of(display_.min.x, display_.max.x) * texel_bytes_;
  const std::size_t stride = span_of(data_.min.x, data_.max.x) * texel_bytes_;
  const int left = std::max(data_.min.x, display_.min.x);
  const int right = std::min(data_.max.x, display_.max.x);
  const bool covers = data_.min.x <= display_.min.x && data_.max.x >= display_.max.x;
  for (std::uint32_t i = 0; i < count; ++i, rows += row_bytes) {
    const int y = display_.min.y + static_cast<int>(first + i);
    const bool inside = y >= data_.min.y && y <= data_.max.y && left <= right;
    if (!inside || !covers) std::memset(rows, 0, row_bytes);
    if (!inside) continue;
    if (block_count_ == 0 || y < block_first_ || y >= block_first_ + block_count_) decode_block(y);
    std::memcpy(rows + span_of(display_.min.x, left - 1) * texel_bytes_,
                block_.data() + static_cast<std::size_t>(y - block_first_) * stride +
                    span_of(data_.min.x, left - 1) * texel_bytes_,
                span_of(left, right) * texel_bytes_);
  }
}

}  // namespace

std::unique_ptr<RowDecoder> open_exr(ByteSource& bytes, const WantedChannels& wanted,
                                     ImageInfo& info) {
  return std::make_unique<ExrDecoder>(bytes, wanted, info);
}

std::vector<std::string> exr_channel_names(ByteSource& bytes) {
  const ExrFile exr(bytes);
  return full_names(parts_of(*exr.file));
}

}  // namespace pounce::io
