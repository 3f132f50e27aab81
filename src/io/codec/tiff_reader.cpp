// SPDX-License-Identifier: Apache-2.0
//
// TIFF by libtiff, behind guard_tiff(), which decides what it sees. Strips are read row by row: of
// a strip that was cut off that gives all rows before the damage, and a large strip is never held
// decoded. Planes of strips lie one after another in the file and each wants a decoder of its own.
#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "core/page_pool.h"
#include "io/codec/guard.h"
#include "io/codec/row_decoder.h"
#include "io/codec/sample.h"
#include "io/codec/tiff_directory.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// A handle of libtiff over the bytes, and what its callbacks see.
class TiffHandle {
 public:
  explicit TiffHandle(ByteSource& bytes) : bytes_(bytes) {
    const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(
        TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), on_error, this);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), on_warning, this);
    tiff_ = TIFFClientOpenExt(bytes.label().c_str(), "rm", this, on_read, on_write, on_seek,
                              on_close, on_size, nullptr, nullptr, options.get());
  }
  ~TiffHandle() {
    if (tiff_ != nullptr) TIFFClose(tiff_);
  }
  TiffHandle(const TiffHandle&) = delete;
  TiffHandle& operator=(const TiffHandle&) = delete;

  TIFF* get() const { return tiff_; }
  /// What libtiff said last of an error, "" if there was none.
  const char* message() const { return message_.data(); }

 private:
  static int on_error(TIFF*, void* self, const char*, const char* format, va_list arguments) {
    auto& message = static_cast<TiffHandle*>(self)->message_;
    std::vsnprintf(message.data(), message.size(), format, arguments);
    return 1;
  }
  static int on_warning(TIFF*, void*, const char*, const char*, va_list) { return 1; }
  static tmsize_t on_read(thandle_t handle, void* out, tmsize_t count) {
    auto& self = *static_cast<TiffHandle*>(handle);
    const std::size_t got =
        self.bytes_.read_at(self.position_, out, static_cast<std::size_t>(count));
    self.position_ += got;
    return static_cast<tmsize_t>(got);
  }
  static tmsize_t on_write(thandle_t, void*, tmsize_t) { return 0; }
  static toff_t on_seek(thandle_t handle, toff_t offset, int whence) {
    auto& self = *static_cast<TiffHandle*>(handle);
    const std::uint64_t from = whence == SEEK_CUR   ? self.position_
                               : whence == SEEK_END ? self.bytes_.size_bytes()
                                                    : 0;
    return self.position_ = from + offset;
  }
  static int on_close(thandle_t) { return 0; }
  static toff_t on_size(thandle_t handle) {
    return static_cast<TiffHandle*>(handle)->bytes_.size_bytes();
  }

  ByteSource& bytes_;
  std::uint64_t position_ = 0;
  std::array<char, 256> message_{};
  TIFF* tiff_ = nullptr;
};

class TiffDecoder : public RowDecoder {
 public:
  TiffDecoder(ByteSource& bytes, ImageInfo& info);
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) override;

 private:
  void open_handles();
  void name_channels(ImageInfo& info);
  void take_palette();
  void count_memory(ImageInfo& info);
  void read_stored(std::uint32_t row);
  void read_tiles(std::uint32_t row);
  std::uint32_t small_sample(std::size_t x, std::size_t s) const;
  void unpack();
  void convert(std::byte* out);
  void check(bool did, const TiffHandle& handle, std::uint32_t row) const;

  /// Decoded bytes of a row of one plane, as the file packs them.
  std::size_t plane_row_bytes() const { return part_row_bytes(picture_.width); }
  std::size_t part_row_bytes(std::uint32_t width) const {
    return (std::size_t{width} * (picture_.planes ? 1 : picture_.samples) * picture_.bits + 7) / 8;
  }

  ByteSource& bytes_;
  TiffPicture picture_;
  std::vector<std::unique_ptr<TiffHandle>> handles_;  ///< one, or one for each plane of strips
  std::vector<int> places_;                           ///< of the image's channels among samples
  std::size_t sample_bytes_ = 1;
  std::uint64_t decoder_bytes_ = 0;
  std::vector<std::array<std::byte, 3>> palette_;
  std::vector<std::byte> row_;          ///< a row of each plane, one behind another
  std::vector<std::byte> texels_;       ///< the same with the samples of a texel side by side
  PageVector<std::byte> tile_, tiles_;  ///< a tile; a row of tiles of each plane, by rows
};

TiffDecoder::TiffDecoder(ByteSource& bytes, ImageInfo& info) : bytes_(bytes) {
  info.levels = tiff_levels(bytes);  // before they are hidden
  std::vector<ColourPiece> colours;
  picture_ = guard_tiff(bytes, colours);
  info.colours = read_colour_tags(colours);
  check_size(bytes.label(), picture_.width, picture_.height);
  open_handles();
  info.width = picture_.width;
  info.height = picture_.height;
  info.depth = picture_.floats       ? picture_.bits == 16 ? Depth::half : Depth::float32
               : picture_.bits == 16 ? Depth::u16
                                     : Depth::u8;
  info.linear = picture_.floats;
  sample_bytes_ = sample_bytes(info.depth);
  if (picture_.tiled) {
    info.tile_width = picture_.part_width;
    info.tile_height = picture_.part_height;
  }
  name_channels(info);
  if (picture_.colours == TiffPicture::Colours::palette) take_palette();
  count_memory(info);
}

void TiffDecoder::open_handles() {
  const std::size_t count = picture_.planes && !picture_.tiled ? picture_.samples : 1;
  for (std::size_t i = 0; i < count; ++i) {
    handles_.push_back(std::make_unique<TiffHandle>(bytes_));
    TIFF* const tiff = handles_.back()->get();
    if (tiff == nullptr)
      decoder_failed(bytes_, "the image header cannot be read",
                     one_line(handles_.back()->message()), 0);
    if (picture_.is_ycbcr) TIFFSetField(tiff, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
    // It makes room by its own reading of the directory, and is handed buffers by ours.
    const bool same =
        picture_.tiled
            ? TIFFIsTiled(tiff) != 0 &&
                  TIFFTileSize64(tiff) ==
                      std::uint64_t{part_row_bytes(picture_.part_width)} * picture_.part_height
            : TIFFIsTiled(tiff) == 0 && TIFFScanlineSize64(tiff) == plane_row_bytes();
    if (!same) {
      throw Error(ErrorKind::input,
                  bytes_.label() +
                      ": the decoder reads the TIFF's header differently; convert it "
                      "to PNG or EXR");
    }
  }
}

/// A sample is alpha where the file says so; nothing else tells.
void TiffDecoder::name_channels(ImageInfo& info) {
  const std::uint32_t count = picture_.channels();
  std::vector<std::string> names = usual_names(std::min(count, 4U), count == 2 || count >= 4);
  for (std::uint32_t c = 4; c < count; ++c) names.push_back(fmt::format("channel{}", c));
  if (count == 2) names = {"R", "G"};
  const auto unnamed = [&](std::uint32_t c) { names[c] = fmt::format("channel{}", c); };
  int alpha = -1;
  std::uint16_t extra = 0;
  std::uint16_t* kinds = nullptr;
  TIFFGetFieldDefaulted(handles_.front()->get(), TIFFTAG_EXTRASAMPLES, &extra, &kinds);
  const std::uint32_t colours = picture_.colours == TiffPicture::Colours::rgb ? 3 : 1;
  if (count >= 4) unnamed(3);
  bool straight = false;
  for (std::uint32_t i = 0; picture_.says_extra_samples && i < extra && colours + i < count; ++i) {
    if (kinds[i] == EXTRASAMPLE_UNSPECIFIED) continue;
    alpha = static_cast<int>(colours + i);
    straight = straight || kinds[i] == EXTRASAMPLE_UNASSALPHA;
  }
  if (alpha >= 0) names[static_cast<std::size_t>(alpha)] = "A";
  if (count == 2 && alpha == 1) names[0] = "Y";
  const ChosenChannels chosen = choose_channels(names, alpha);
  if (chosen.places.empty()) throw too_many_channels(bytes_.label(), names);
  places_ = chosen.places;
  info.channels = static_cast<std::uint32_t>(places_.size());
  info.has_alpha = chosen.has_alpha;
  info.premultiplied = info.has_alpha && !straight;
  info.names = chosen.names;
  info.left_out = chosen.left_out;
}

/// Of 16 bits; the upper eight are the colour.
void TiffDecoder::take_palette() {
  std::array<std::uint16_t*, 3> maps{};
  if (TIFFGetField(handles_.front()->get(), TIFFTAG_COLORMAP, &maps[0], &maps[1], &maps[2]) == 0)
    refuse_damaged(bytes_.label(), "its palette cannot be read", "");
  for (std::size_t i = 0; i < std::size_t{1} << picture_.bits; ++i) {
    std::array<std::byte, 3> colour;
    for (std::size_t c = 0; c < 3; ++c) colour[c] = static_cast<std::byte>(maps[c][i] / 257);
    palette_.push_back(colour);
  }
}

void TiffDecoder::count_memory(ImageInfo& info) {
  const std::uint64_t planes = picture_.planes ? picture_.samples : 1;
  row_.resize(plane_row_bytes() * planes);
  info.decoder_bytes = kDecoderBaseBytes + 2 * row_.size() +
                       row_.size() * 8 / picture_.bits * sample_bytes_ +
                       handles_.size() * picture_.window_bytes;
  if (picture_.tiled) {
    const std::uint64_t across = (picture_.width - 1) / picture_.part_width + 1;
    // Decoded and as they are in the file.
    info.decoder_bytes += picture_.part_bytes() * (across * planes + 3);
  } else {
    // A strip as it is in the file, however large.
    info.decoder_bytes +=
        planes * (kDecoderBaseBytes / 4 + std::min(2 * picture_.part_bytes(), bytes_.size_bytes()));
  }
  decoder_bytes_ = info.decoder_bytes;
}

void TiffDecoder::check(bool did, const TiffHandle& handle, std::uint32_t row) const {
  if (did && handle.message()[0] == '\0' && bytes_.failure() == 0) return;
  decoder_failed(bytes_, fmt::format("decoding failed in row {} of {}", row, picture_.height),
                 one_line(handle.message()), decoder_bytes_);
}

/// The row of tiles that `row` begins.
void TiffDecoder::read_tiles(std::uint32_t row) {
  const TiffHandle& handle = *handles_.front();
  const std::size_t part_row = part_row_bytes(picture_.part_width);
  const std::uint32_t across = (picture_.width - 1) / picture_.part_width + 1;
  const std::size_t stride = part_row * across;
  const std::uint32_t planes = picture_.planes ? picture_.samples : 1;
  tile_.resize(part_row * picture_.part_height);
  tiles_.resize(stride * picture_.part_height * planes);
  for (std::uint32_t plane = 0; plane < planes; ++plane) {
    for (std::uint32_t i = 0; i < across; ++i) {
      // Whatever a decoder leaves out is the same in every run.
      std::fill(tile_.begin(), tile_.end(), std::byte{});
      const std::uint32_t number = TIFFComputeTile(handle.get(), i * picture_.part_width, row, 0,
                                                   static_cast<std::uint16_t>(plane));
      const tmsize_t got = TIFFReadEncodedTile(handle.get(), number, tile_.data(),
                                               static_cast<tmsize_t>(tile_.size()));
      check(got == static_cast<tmsize_t>(tile_.size()), handle, row);
      for (std::size_t y = 0; y < picture_.part_height; ++y) {
        std::memcpy(tiles_.data() + (plane * picture_.part_height + y) * stride + i * part_row,
                    tile_.data() + y * part_row, part_row);
      }
    }
  }
}

/// One row, as the file packs it, into row_.
void TiffDecoder::read_stored(std::uint32_t row) {
  const std::size_t plane_row = plane_row_bytes();
  const std::size_t planes = row_.size() / plane_row;
  if (!picture_.tiled) {
    std::fill(row_.begin(), row_.end(), std::byte{});
    for (std::size_t p = 0; p < planes; ++p) {
      const int status = TIFFReadScanline(handles_[p]->get(), row_.data() + p * plane_row, row,
                                          static_cast<std::uint16_t>(p));
      check(status > 0, *handles_[p], row);
    }
    return;
  }
  const std::uint32_t in_tile = row % picture_.part_height;
  if (in_tile == 0) read_tiles(row);
  const std::size_t stride = tiles_.size() / planes / picture_.part_height;
  for (std::size_t p = 0; p < planes; ++p) {
    std::memcpy(row_.data() + p * plane_row,
                tiles_.data() + (p * picture_.part_height + in_tile) * stride, plane_row);
  }
}

/// Sample `s` of texel `x` of row_, of less than 8 bits.
std::uint32_t TiffDecoder::small_sample(std::size_t x, std::size_t s) const {
  const std::size_t bits = picture_.bits;
  const std::size_t bit =
      picture_.planes ? 8 * s * plane_row_bytes() + x * bits : (x * picture_.samples + s) * bits;
  const auto byte = static_cast<std::uint32_t>(row_[bit / 8]);
  return byte >> (8 - bits - bit % 8) & ((1U << bits) - 1);
}

/// row_ with its samples side by side, of 8 bits and more.
void TiffDecoder::unpack() {
  const std::size_t width = picture_.width, samples = picture_.samples, size = sample_bytes_;
  texels_.resize(width * samples * size);
  std::byte* out = texels_.data();
  for (std::size_t x = 0; x < width; ++x) {
    for (std::size_t s = 0; s < samples; ++s, out += size) {
      if (picture_.bits < 8) {
        *out = static_cast<std::byte>(small_sample(x, s) * 255 / ((1U << picture_.bits) - 1));
      } else {
        const std::size_t at =
            picture_.planes ? s * plane_row_bytes() + x * size : (x * samples + s) * size;
        std::memcpy(out, row_.data() + at, size);
      }
    }
  }
}

namespace {

/// Whole numbers, turned round.
template <class Sample>
void invert(std::vector<std::byte>& samples) {
  for (std::size_t i = 0; i < samples.size(); i += sizeof(Sample)) {
    Sample sample;
    std::memcpy(&sample, samples.data() + i, sizeof sample);
    sample = static_cast<Sample>(~sample);
    std::memcpy(samples.data() + i, &sample, sizeof sample);
  }
}

/// Of four inks what they leave of white: (1 - ink) (1 - black), to the nearest number.
template <class Sample>
void from_inks(const std::vector<std::byte>& inks, std::byte* out) {
  constexpr std::uint64_t kFull = std::numeric_limits<Sample>::max();
  for (std::size_t i = 0; i < inks.size(); i += 4 * sizeof(Sample)) {
    std::array<Sample, 4> ink;
    std::memcpy(ink.data(), inks.data() + i, sizeof ink);
    for (std::size_t c = 0; c < 3; ++c) {
      const auto value =
          static_cast<Sample>(((kFull - ink[c]) * (kFull - ink[3]) + kFull / 2) / kFull);
      std::memcpy(out, &value, sizeof value);
      out += sizeof value;
    }
  }
}

}  // namespace

/// row_ as samples of the image.
void TiffDecoder::convert(std::byte* out) {
  using Colours = TiffPicture::Colours;
  const std::size_t size = sample_bytes_;
  if (picture_.colours == Colours::palette) {
    for (std::size_t x = 0; x < picture_.width; ++x) {
      const std::uint32_t index =
          picture_.bits == 8 ? static_cast<std::uint32_t>(row_[x]) : small_sample(x, 0);
      out = std::copy(palette_[index].begin(), palette_[index].end(), out);
    }
    return;
  }
  const bool all =
      places_.size() == picture_.samples && std::is_sorted(places_.begin(), places_.end());
  if (all && picture_.bits >= 8 && !picture_.planes && picture_.colours != Colours::cmyk &&
      picture_.colours != Colours::grey_inverted) {
    std::memcpy(out, row_.data(), row_.size());
    return;
  }
  unpack();
  if (picture_.colours == Colours::cmyk)
    return size == 2 ? from_inks<std::uint16_t>(texels_, out)
                     : from_inks<std::uint8_t>(texels_, out);
  if (picture_.colours == Colours::grey_inverted)
    size == 2 ? invert<std::uint16_t>(texels_) : invert<std::uint8_t>(texels_);
  const std::size_t texel = size * picture_.samples;
  for (std::size_t x = 0; x < picture_.width; ++x) {
    for (const int place : places_) {
      std::memcpy(out, texels_.data() + x * texel + static_cast<std::size_t>(place) * size, size);
      out += size;
    }
  }
}

void TiffDecoder::read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) {
  const std::size_t row_bytes = std::size_t{picture_.width} * places_.size() * sample_bytes_;
  for (std::uint32_t y = 0; y < count; ++y) {
    read_stored(first + y);
    convert(rows + y * row_bytes);
  }
}

}  // namespace

std::unique_ptr<RowDecoder> open_tiff(ByteSource& bytes, ImageInfo& info) {
  return std::make_unique<TiffDecoder>(bytes, info);
}

}  // namespace pounce::io
