// SPDX-License-Identifier: Apache-2.0
//
// TIFF by libtiff: deflate with a predictor, strips or tiles. Levels are further images of the same
// file, with the attributes of maketx, less what readers believe of no other program (mean and
// constant colour, hash of the samples).
#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <memory>
#include <vector>

#include "core/page_pool.h"
#include "io/codec/colour_tags.h"
#include "io/codec/row_encoder.h"
#include "io/codec/sample.h"
#include "io/files/finished_output.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

class TiffEncoder : public RowEncoder {
 public:
  TiffEncoder(OutputFile& file, const ImageWriteSpec& spec);
  ~TiffEncoder() override {
    if (tiff_ != nullptr) TIFFCleanup(tiff_);  // writes no directory of an image that is not whole
  }
  void write_rows(std::uint32_t first, std::uint32_t count, const std::byte* rows) override;
  void next_level(std::uint32_t width, std::uint32_t height) override;
  void finish() override;

 private:
  void set_fields(bool is_first);
  void set_extra_samples();
  void write_tiles(std::uint32_t first, std::uint32_t count, const std::byte* rows);
  void check(bool did);

  static int on_error(TIFF*, void* self, const char*, const char* format, va_list arguments) {
    auto& message = static_cast<TiffEncoder*>(self)->message_;
    std::vsnprintf(message.data(), message.size(), format, arguments);
    return 1;
  }
  static int on_warning(TIFF*, void*, const char*, const char*, va_list) { return 1; }
  static OutputFile& file_of(thandle_t handle) { return static_cast<TiffEncoder*>(handle)->file_; }
  static tmsize_t on_read(thandle_t handle, void* out, tmsize_t count) {
    OutputFile& file = file_of(handle);
    const long at = std::ftell(file.stream());
    const std::size_t got = file.read_back(at, out, static_cast<std::size_t>(count));
    std::fseek(file.stream(), at + static_cast<long>(got), SEEK_SET);
    return static_cast<tmsize_t>(got);
  }
  static tmsize_t on_write(thandle_t handle, void* bytes, tmsize_t count) {
    return static_cast<tmsize_t>(
        std::fwrite(bytes, 1, static_cast<std::size_t>(count), file_of(handle).stream()));
  }
  static toff_t on_seek(thandle_t handle, toff_t offset, int whence) {
    FILE* const stream = file_of(handle).stream();
    if (std::fseek(stream, static_cast<long>(offset), whence) != 0) return UINT64_MAX;
    return static_cast<toff_t>(std::ftell(stream));
  }
  static int on_close(thandle_t) { return 0; }
  static toff_t on_size(thandle_t handle) { return file_of(handle).size_bytes(); }

  OutputFile& file_;
  ImageWriteSpec spec_;
  float fovcot_ = 1;
  TIFF* tiff_ = nullptr;
  std::array<char, 256> message_{};
  std::vector<std::byte> row_;  ///< libtiff's predictors work in place
  PageVector<std::byte> tile_;
};

TiffEncoder::TiffEncoder(OutputFile& file, const ImageWriteSpec& spec) : file_(file), spec_(spec) {
  // A classic TIFF ends at 4 GiB.
  constexpr std::uint64_t kMostClassicBytes = 4000ULL << 20;
  const std::uint64_t texels =
      spec.layout.tile_size > 0 ? tiled_texels(spec) : std::uint64_t{spec.width} * spec.height;
  const bool is_big = texels * spec.channels * sample_bytes(spec.depth) > kMostClassicBytes;
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), on_error, this);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), on_warning, this);
  tiff_ = TIFFClientOpenExt("image", is_big ? "w8" : "w", this, on_read, on_write, on_seek,
                            on_close, on_size, nullptr, nullptr, options.get());
  fovcot_ = static_cast<float>(spec.width) / static_cast<float>(spec.height);
  check(tiff_ != nullptr);
  set_fields(true);
}

void TiffEncoder::check(bool did) {
  file_.check();
  if (!did) file_.fail(message_[0] == '\0' ? "the encoder reported no reason" : message_.data());
}

void TiffEncoder::set_fields(bool is_first) {
  const bool is_float = spec_.depth == Depth::half || spec_.depth == Depth::float32;
  const int bits = static_cast<int>(8 * sample_bytes(spec_.depth));
  TIFFSetField(tiff_, TIFFTAG_IMAGEWIDTH, spec_.width);
  TIFFSetField(tiff_, TIFFTAG_IMAGELENGTH, spec_.height);
  TIFFSetField(tiff_, TIFFTAG_BITSPERSAMPLE, bits);
  TIFFSetField(tiff_, TIFFTAG_SAMPLEFORMAT, is_float ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
  TIFFSetField(tiff_, TIFFTAG_SAMPLESPERPIXEL, static_cast<int>(spec_.channels));
  TIFFSetField(tiff_, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff_, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  TIFFSetField(tiff_, TIFFTAG_PHOTOMETRIC,
               spec_.channels >= 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK);
  set_extra_samples();
  TIFFSetField(tiff_, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
  TIFFSetField(tiff_, TIFFTAG_ZIPQUALITY, kDeflateLevel);
  TIFFSetField(tiff_, TIFFTAG_PREDICTOR, is_float ? PREDICTOR_FLOATINGPOINT : PREDICTOR_HORIZONTAL);
  if (const std::uint32_t edge = spec_.layout.tile_size; edge > 0) {
    TIFFSetField(tiff_, TIFFTAG_TILEWIDTH, edge);
    TIFFSetField(tiff_, TIFFTAG_TILELENGTH, edge);
  } else {
    TIFFSetField(tiff_, TIFFTAG_ROWSPERSTRIP, strip_rows(spec_));
  }
  TIFFSetField(tiff_, TIFFTAG_SOFTWARE, software_name().c_str());
  if (spec_.layout.mipmap) {
    TIFFSetField(tiff_, TIFFTAG_PIXAR_TEXTUREFORMAT, "Plain Texture");
    TIFFSetField(tiff_, TIFFTAG_PIXAR_WRAPMODES, "black,black");
    TIFFSetField(tiff_, TIFFTAG_PIXAR_FOVCOT, static_cast<double>(fovcot_));
  }
  if (!is_first) return;  // the first one's are all that is read
  if (!spec_.job.empty())
    TIFFSetField(tiff_, TIFFTAG_IMAGEDESCRIPTION, job_description(spec_.job).c_str());
  if (spec_.chromaticities) {
    const std::vector<std::byte> profile = make_icc({*spec_.chromaticities, spec_.linear});
    TIFFSetField(tiff_, TIFFTAG_ICCPROFILE, static_cast<std::uint32_t>(profile.size()),
                 profile.data());
  }
}

/// Levels are of colours times alpha.
void TiffEncoder::set_extra_samples() {
  const std::uint32_t extra = spec_.channels - (spec_.channels >= 3 ? 3 : 1);
  if (extra == 0) return;
  const std::uint16_t kind = !spec_.has_alpha      ? EXTRASAMPLE_UNSPECIFIED
                             : spec_.layout.mipmap ? EXTRASAMPLE_ASSOCALPHA
                                                   : EXTRASAMPLE_UNASSALPHA;
  TIFFSetField(tiff_, TIFFTAG_EXTRASAMPLES, 1, &kind);
}

void TiffEncoder::write_rows(std::uint32_t first, std::uint32_t count, const std::byte* rows) {
  if (spec_.layout.tile_size > 0) return write_tiles(first, count, rows);
  const std::size_t size = row_bytes_of(spec_);
  for (std::uint32_t y = 0; y < count; ++y) {
    row_.assign(rows + y * size, rows + (y + 1) * size);
    check(TIFFWriteScanline(tiff_, row_.data(), first + y, 0) == 1);
  }
}

/// What a tile has beyond the image is in the file, too: zeros.
void TiffEncoder::write_tiles(std::uint32_t first, std::uint32_t count, const std::byte* rows) {
  const std::uint32_t edge = spec_.layout.tile_size;
  const std::size_t texel = spec_.channels * sample_bytes(spec_.depth);
  const std::size_t size = row_bytes_of(spec_);
  for (std::uint32_t x = 0; x < spec_.width; x += edge) {
    tile_.assign(std::size_t{edge} * edge * texel, std::byte{});
    const std::size_t across = std::min(edge, spec_.width - x) * texel;
    for (std::uint32_t y = 0; y < count; ++y)
      std::memcpy(tile_.data() + y * edge * texel, rows + y * size + x * texel, across);
    const std::uint32_t number = TIFFComputeTile(tiff_, x, first, 0, 0);
    const auto bytes = static_cast<tmsize_t>(tile_.size());
    check(TIFFWriteEncodedTile(tiff_, number, tile_.data(), bytes) == bytes);
  }
}

void TiffEncoder::next_level(std::uint32_t width, std::uint32_t height) {
  check(TIFFWriteDirectory(tiff_) == 1);
  spec_.width = width;
  spec_.height = height;
  set_fields(false);
}

void TiffEncoder::finish() {
  // The directory of the last image, and what the others' links are.
  check(TIFFFlush(tiff_) == 1);
  TIFFCleanup(tiff_);
  tiff_ = nullptr;
  file_.check();
}

}  // namespace

std::unique_ptr<RowEncoder> encode_tiff(OutputFile& file, const ImageWriteSpec& spec) {
  return std::make_unique<TiffEncoder>(file, spec);
}

}  // namespace pounce::io
