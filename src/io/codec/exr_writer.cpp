// SPDX-License-Identifier: Apache-2.0
//
// EXR by OpenEXR: scanlines or tiles, with the attributes of maketx where there are levels.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfTiledOutputFile.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "io/codec/row_encoder.h"
#include "io/codec/sample.h"
#include "io/files/finished_output.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

class FileStream : public Imf::OStream {
 public:
  explicit FileStream(OutputFile& file) : OStream("image"), file_(file) {}
  void write(const char* bytes, int count) override {
    const auto size = static_cast<std::size_t>(count);
    if (std::fwrite(bytes, 1, size, file_.stream()) != size)
      throw std::runtime_error("it cannot be written");
  }
  std::uint64_t tellp() override { return static_cast<std::uint64_t>(std::ftell(file_.stream())); }
  void seekp(std::uint64_t to) override {
    std::fseek(file_.stream(), static_cast<long>(to), SEEK_SET);
  }

 private:
  OutputFile& file_;
};

Imf::Compression compression_of(const std::string& name) {
  constexpr std::array<std::pair<std::string_view, Imf::Compression>, 4> kNames{
      {{"none", Imf::NO_COMPRESSION},
       {"rle", Imf::RLE_COMPRESSION},
       {"zips", Imf::ZIPS_COMPRESSION},
       {"piz", Imf::PIZ_COMPRESSION}}};
  for (const auto& [known, compression] : kNames) {
    if (name == known) return compression;
  }
  return Imf::ZIP_COMPRESSION;
}

std::vector<std::string> names_of(const ImageWriteSpec& spec) {
  return spec.names.empty() ? usual_names(spec.channels, spec.has_alpha) : spec.names;
}

Imf::Header header_of(const ImageWriteSpec& spec) {
  Imf::Header header(static_cast<int>(spec.width), static_cast<int>(spec.height));
  header.compression() = compression_of(spec.layout.exr_compression);
  header.zipCompressionLevel() = kDeflateLevel;
  const Imf::PixelType type = spec.depth == Depth::half ? Imf::HALF : Imf::FLOAT;
  for (const std::string& name : names_of(spec)) header.channels().insert(name, Imf::Channel(type));
  if (spec.chromaticities) {
    const Chromaticities& c = *spec.chromaticities;
    Imf::addChromaticities(header, {{c[0], c[1]}, {c[2], c[3]}, {c[4], c[5]}, {c[6], c[7]}});
  }
  header.insert("Software", Imf::StringAttribute(software_name()));
  if (!spec.job.empty()) header.insert("comments", Imf::StringAttribute(job_description(spec.job)));
  if (!spec.hits_note.empty()) header.insert(kHitsAttribute, Imf::StringAttribute(spec.hits_note));
  if (const std::uint32_t edge = spec.layout.tile_size; edge > 0) {
    header.setTileDescription(Imf::TileDescription(
        edge, edge, spec.layout.mipmap ? Imf::MIPMAP_LEVELS : Imf::ONE_LEVEL, Imf::ROUND_DOWN));
  }
  if (spec.layout.mipmap) {
    header.insert("textureformat", Imf::StringAttribute("Plain Texture"));
    header.insert("wrapmodes", Imf::StringAttribute("black,black"));
    header.insert("fovcot", Imf::FloatAttribute(static_cast<float>(spec.width) /
                                                static_cast<float>(spec.height)));
  }
  return header;
}

class ExrEncoder : public RowEncoder {
 public:
  ExrEncoder(OutputFile& file, const ImageWriteSpec& spec)
      : file_(file), stream_(file), spec_(spec), names_(names_of(spec)) {
    run([&] {
      if (spec.layout.tile_size > 0) {
        tiles_.emplace(stream_, header_of(spec), 0);
      } else {
        scanlines_.emplace(stream_, header_of(spec), 0);
      }
    });
  }
  /// OpenEXR writes a table when it is closed, in whatever state the file is.
  ~ExrEncoder() override {
    try {
      tiles_.reset();
      scanlines_.reset();
    } catch (const std::exception&) {
    }
  }

  void write_rows(std::uint32_t first, std::uint32_t count, const std::byte* rows) override {
    const std::size_t sample = sample_bytes(spec_.depth), texel = sample * spec_.channels;
    Imf::FrameBuffer frame;
    for (std::size_t c = 0; c < names_.size(); ++c) {
      frame.insert(names_[c],
                   Imf::Slice::Make(spec_.depth == Depth::half ? Imf::HALF : Imf::FLOAT,
                                    rows + c * sample, Imath::V2i(0, static_cast<int>(first)),
                                    spec_.width, count, texel, texel * spec_.width));
    }
    run([&] {
      if (tiles_) {
        const int row = static_cast<int>(first / spec_.layout.tile_size);
        tiles_->setFrameBuffer(frame);
        tiles_->writeTiles(0, tiles_->numXTiles(level_) - 1, row, row, level_, level_);
      } else {
        scanlines_->setFrameBuffer(frame);
        scanlines_->writePixels(static_cast<int>(count));
      }
    });
  }
  void next_level(std::uint32_t width, std::uint32_t height) override {
    spec_.width = width;
    spec_.height = height;
    ++level_;
  }
  void finish() override {
    run([this] {
      tiles_.reset();
      scanlines_.reset();
    });
  }

 private:
  template <class Step>
  void run(Step step) {
    try {
      step();
    } catch (const std::exception& e) {
      file_.check();
      file_.fail(e.what());
    }
    file_.check();
  }

  OutputFile& file_;
  FileStream stream_;
  ImageWriteSpec spec_;  ///< of the level
  std::vector<std::string> names_;
  int level_ = 0;
  std::optional<Imf::OutputFile> scanlines_;
  std::optional<Imf::TiledOutputFile> tiles_;
};

}  // namespace

std::unique_ptr<RowEncoder> encode_exr(OutputFile& file, const ImageWriteSpec& spec) {
  return std::make_unique<ExrEncoder>(file, spec);
}

}  // namespace pounce::io
