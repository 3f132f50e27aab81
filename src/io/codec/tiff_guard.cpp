// SPDX-License-Identifier: Apache-2.0
//
// A TIFF says of itself in any number of fields how its samples are coded, and a decoder believes
// each of them somewhere else. So it is not left to it. The first directory is read here, field by
// field, and held against a list of what is read; a decoder is shown a directory that holds these
// fields and no other. What they say together is checked too: every strip and tile lies within the
// file, and there are as many as the size asks for.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "io/codec/guard.h"
#include "io/codec/tiff_directory.h"
#include "io/codec/tiff_window.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kLargestSide = 65536;
/// libtiff keeps 16 bytes for each strip or tile, and twice that while it reads the lists: no
/// budget knows of it. 65536 x 65536 in tiles of 64 x 64 are as many.
constexpr std::uint64_t kMostParts = 1 << 20;
constexpr std::uint64_t kMostSamples = 64;
/// Tiles may be larger than the image. Renderers' are 64 texels wide, GIS's 512 or less.
constexpr std::uint64_t kMostTileBytes = 64 << 20;

struct Name {
  std::uint64_t value;
  std::string_view name;
};
/// "JPEG", or the number itself.
template <std::size_t N>
std::string name_of(const std::array<Name, N>& names, std::uint64_t value) {
  for (const Name& known : names) {
    if (known.value == value) return std::string(known.name);
  }
  return fmt::format("type {}", value);
}

void take_size(TiffDirectory& from, TiffPicture& picture) {
  const std::uint64_t width = from.needed(kWidth, "width");
  const std::uint64_t height = from.needed(kHeight, "height");
  if (width < 1 || height < 1 || width > kLargestSide || height > kLargestSide) {
    from.refuse(fmt::format("the image is {} x {} texels, but each side must be 1 to {}", width,
                            height, kLargestSide));
  }
  picture.width = static_cast<std::uint32_t>(width);
  picture.height = static_cast<std::uint32_t>(height);
}

/// Bits, types and number of the samples.
void take_samples(TiffDirectory& from, TiffPicture& picture) {
  const std::uint64_t samples = from.number(kSamples, 1);
  if (samples < 1 || samples > kMostSamples) {
    from.refuse(fmt::format("the TIFF has {} samples per texel, but only 1 to {} are supported",
                            samples, kMostSamples));
  }
  // One bit where nothing is said, which nobody means.
  if (from.find(kBits) == nullptr)
    from.refuse(fmt::format("the TIFF does not state its bits per sample (field {}); save it again",
                            static_cast<int>(kBits)));
  const std::uint64_t bits = from.of_all_samples(kBits, samples, 1);
  const std::uint64_t format = from.of_all_samples(kSampleFormat, samples, 1);
  constexpr std::uint64_t kUnsigned = 1, kFloat = 3;
  picture.floats = format == kFloat;
  const bool small = bits == 1 || bits == 2 || bits == 4;
  const bool whole = format == kUnsigned && (bits == 8 || bits == 16 || small);
  const bool real = picture.floats && (bits == 16 || bits == 32);
  if (!whole && !real) {
    constexpr std::array<std::string_view, 7> kKinds{"unknown", "unsigned", "signed",       "float",
                                                     "untyped", "complex",  "complex float"};
    from.refuse(
        fmt::format("{}-bit {} samples are not supported; convert it to 8-bit or 16-bit unsigned "
                    "integers, half "
                    "or float",
                    bits, format < kKinds.size() ? kKinds[format] : kKinds[0]));
  }
  picture.samples = static_cast<std::uint32_t>(samples);
  picture.bits = static_cast<std::uint32_t>(bits);
}

[[noreturn]] void refuse_colours(const TiffDirectory& from, const TiffPicture& picture,
                                 std::uint64_t photometric) {
  constexpr auto kNames = std::to_array<Name>({{0, "white-is-zero"},
                                               {2, "RGB"},
                                               {3, "palette"},
                                               {4, "mask"},
                                               {5, "ink"},
                                               {6, "YCbCr"},
                                               {8, "CIELAB"},
                                               {9, "ICCLAB"},
                                               {10, "ITULAB"},
                                               {32803, "camera sensor"},
                                               {32844, "LogL"},
                                               {32845, "LogLuv"},
                                               {34892, "camera sensor"}});
  from.refuse(fmt::format(
      "TIFF images of {} colours with {} samples of {} bits per texel are not supported; convert "
      "it to RGB or grey of 8 or 16 bits, half or float",
      name_of(kNames, photometric), picture.samples, picture.bits));
}

/// What the samples mean.
void take_colours(TiffDirectory& from, TiffPicture& picture) {
  using Colours = TiffPicture::Colours;
  const std::uint64_t photometric = from.needed(kPhotometric, "photometric interpretation");
  constexpr std::uint64_t kWhiteIsZero = 0, kBlackIsZero = 1, kRgb = 2, kPalette = 3, kInks = 5,
                          kYCbCr = 6, kJpeg = 7;
  const bool one_integer = picture.samples == 1 && !picture.floats;
  if (photometric == kBlackIsZero) {
    picture.colours = Colours::grey;
  } else if (photometric == kWhiteIsZero && one_integer) {
    picture.colours = Colours::grey_inverted;
  } else if (photometric == kRgb && picture.samples >= 3) {
    picture.colours = Colours::rgb;
  } else if (photometric == kInks && picture.samples == 4 && !picture.floats &&
             from.number(kInkSet, 1) == 1) {
    picture.colours = Colours::cmyk;
  } else if (photometric == kYCbCr && picture.samples == 3 && picture.bits == 8 &&
             from.number(kCompression, 1) == kJpeg) {
    picture.colours = Colours::rgb;
    picture.is_ycbcr = true;
    from.use(kSubsampling);
  } else if (photometric == kPalette && one_integer && picture.bits <= 8) {
    picture.colours = Colours::palette;
    const TiffField* const map = from.use(kColourMap);
    if (map == nullptr)
      from.refuse("the TIFF has palette indices, but no palette; the file is damaged");
    if (map->type != kShort)
      from.refuse("the TIFF's palette is not a list of 16-bit integers; the file is damaged");
    from.numbers(*map, std::uint64_t{3} << picture.bits);
  } else {
    refuse_colours(from, picture, photometric);
  }
  const std::uint64_t extra = picture.samples - (picture.colours == Colours::rgb    ? 3
                                                 : picture.colours == Colours::cmyk ? 4
                                                                                    : 1);
  if (const TiffField* const said = from.use(kExtraSamples)) {
    picture.says_extra_samples = true;
    constexpr std::uint64_t kStraightAlpha = 2;
    for (const std::uint64_t kind : from.numbers(*said, extra)) {
      if (kind > kStraightAlpha)
        from.refuse(fmt::format(
            "the TIFF has extra samples of the unknown type {}; the file is damaged", kind));
    }
  }
  if (from.find(kMatteing) != nullptr && !picture.says_extra_samples) {
    // Some writers state that there is none, which needs no extra sample.
    if (from.number(kMatteing, 0) > std::min<std::uint64_t>(extra, 1))
      from.refuse("the TIFF's field 32995 (Matteing) is invalid; the file is damaged");
    picture.says_extra_samples = extra > 0;
  }
}

constexpr std::uint64_t kLzma = 34925, kZstd = 50000;

void take_coding(TiffDirectory& from, TiffPicture& picture) {
  constexpr std::uint64_t kNone = 1, kRle = 2, kFax = 3, kFax4 = 4, kLzw = 5, kJpeg = 7,
                          kDeflate = 8, kOldDeflate = 32946, kPackBits = 32773;
  const std::uint64_t coding = from.number(kCompression, kNone);
  const bool predicts = coding == kLzw || coding == kDeflate || coding == kOldDeflate ||
                        coding == kLzma || coding == kZstd;
  const bool is_fax = (coding == kRle || coding == kFax || coding == kFax4) && picture.bits == 1 &&
                      picture.samples == 1;
  picture.is_jpeg = coding == kJpeg && picture.bits == 8 && !picture.floats;
  if (is_fax) {
    from.use(kFaxOptions);
    from.use(kFax4Options);
  }
  if (picture.is_jpeg) from.use(kJpegTables);
  if (!predicts && !is_fax && !picture.is_jpeg && coding != kNone && coding != kPackBits) {
    constexpr auto kNames = std::to_array<Name>({{2, "CCITT"},
                                                 {3, "CCITT fax"},
                                                 {4, "CCITT fax"},
                                                 {6, "old JPEG"},
                                                 {7, "JPEG"},
                                                 {32766, "NeXT"},
                                                 {32809, "ThunderScan"},
                                                 {32909, "PixarLog"},
                                                 {34661, "JBIG"},
                                                 {34676, "SGILog"},
                                                 {34677, "SGILog"},
                                                 {34712, "JPEG 2000"},
                                                 {34887, "LERC"},
                                                 {50001, "WebP"}});
    from.refuse(fmt::format(
        "the TIFF's compression is {}, which is not supported for its samples; save it with ZIP "
        "(Deflate), LZW, PackBits or no compression",
        name_of(kNames, coding)));
  }
  picture.compressed = coding != kNone;
  if (predicts) {
    constexpr std::uint64_t kDifferences = 2, kFloatDifferences = 3;
    const std::uint64_t predictor = from.number(kPredictor, 1);
    const bool fits = predictor == 1 || (predictor == kDifferences && picture.bits >= 8) ||
                      (predictor == kFloatDifferences && picture.floats);
    if (!fits) {
      from.refuse(
          fmt::format("the TIFF's predictor {} is invalid for {}-bit samples; the file is damaged",
                      predictor, picture.bits));
    }
  }
  if (const std::uint64_t order = from.number(kFillOrder, 1); order < 1 || order > 2)
    from.refuse(fmt::format("the TIFF's fill order {} is invalid; the file is damaged", order));
  const std::uint64_t planes = from.number(kPlanes, 1);
  if (planes < 1 || planes > 2)
    from.refuse(
        fmt::format("the TIFF's planar configuration {} is invalid; the file is damaged", planes));
  picture.planes = planes == 2 && picture.samples > 1;
}

/// The size of strips or tiles. After take_coding().
void take_part_size(TiffDirectory& from, TiffPicture& picture) {
  picture.tiled = from.find(kTileWidth) != nullptr || from.find(kTileHeight) != nullptr;
  if (!picture.tiled) {
    const std::uint64_t rows = from.number(kStripRows, UINT32_MAX);
    if (rows < 1) from.refuse("the TIFF's strips have no rows; the file is damaged");
    picture.part_width = picture.width;
    picture.part_height = static_cast<std::uint32_t>(std::min<std::uint64_t>(rows, picture.height));
    return;
  }
  const std::uint64_t width = from.needed(kTileWidth, "tile width");
  const std::uint64_t height = from.needed(kTileHeight, "tile height");
  if (width < 16 || height < 16 || width % 16 != 0 || height % 16 != 0 || width > kLargestSide ||
      height > kLargestSide) {
    from.refuse(fmt::format(
        "the TIFF's tiles are {} x {} texels, but each side must be a multiple of 16 up to {}",
        width, height, kLargestSide));
  }
  picture.part_width = static_cast<std::uint32_t>(width);
  picture.part_height = static_cast<std::uint32_t>(height);
  if (picture.part_bytes() > kMostTileBytes) {
    from.refuse(fmt::format(
        "the TIFF's tiles of {} x {} texels have {} MiB each, but at most {} MiB are supported; "
        "save it with smaller tiles",
        width, height, picture.part_bytes() >> 20, kMostTileBytes >> 20));
  }
}

/// How far back the decoder of a strip or tile looks.
std::uint64_t window_of(std::uint64_t coding, ByteSource& bytes, std::uint64_t begin,
                        std::uint64_t size) {
  if (coding == kZstd) return zstd_window(bytes, begin, size);
  return coding == kLzma ? xz_window(bytes, begin, size) : 0;
}

/// Where the strips or tiles are: as many as there must be, each within the file, none much larger
/// than what it decodes to.
void check_parts(TiffDirectory& from, TiffPicture& picture) {
  const std::uint64_t across = (picture.width - 1) / picture.part_width + 1;
  const std::uint64_t down = (picture.height - 1) / picture.part_height + 1;
  const std::uint64_t of_plane = across * down;
  const std::uint64_t count = of_plane * (picture.planes ? picture.samples : 1);
  const std::string_view name = picture.tiled ? "tile" : "strip";
  if (count > kMostParts) {
    from.refuse(fmt::format(
        "the TIFF has {0} {1}s, but at most {2} are supported; save it with larger {1}s", count,
        name, kMostParts));
  }
  const TiffField* const places = from.use(picture.tiled ? kTileOffsets : kStripOffsets);
  const TiffField* const sizes = from.use(picture.tiled ? kTileBytes : kStripBytes);
  if (places == nullptr || sizes == nullptr)
    from.refuse(fmt::format(
        "the TIFF does not state the offsets and sizes of its {}s; the file is damaged", name));
  const std::vector<std::uint64_t> begins = from.numbers(*places, count);
  const std::vector<std::uint64_t> bytes = from.numbers(*sizes, count);
  const std::uint64_t row = picture.part_bytes() / picture.part_height;
  const std::uint64_t coding = from.number(kCompression, 0);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t first_row = i % of_plane / across * picture.part_height;
    const std::uint64_t rows =
        picture.tiled ? picture.part_height
                      : std::min<std::uint64_t>(picture.part_height, picture.height - first_row);
    const std::uint64_t decoded = row * rows;
    constexpr std::uint64_t kSlack = 4096;
    const std::uint64_t least = picture.compressed ? 1 : decoded;
    const bool inside = begins[i] <= from.at().size() && bytes[i] <= from.at().size() - begins[i];
    if (inside && bytes[i] >= least && bytes[i] <= 2 * decoded + kSlack) {
      picture.window_bytes =
          std::max(picture.window_bytes, window_of(coding, from.at().bytes(), begins[i], bytes[i]));
      continue;
    }
    from.refuse(fmt::format(
        "{} {} of {} of the TIFF has {} bytes at offset {} (decoded: {} bytes), in a file of "
        "{} bytes; the file is damaged or truncated",
        name, i + 1, count, bytes[i], begins[i], decoded, from.at().size()));
  }
  // libtiff takes counts that differ for wrong ones there, and goes by its own of as many rows in
  // each strip, of which whole strips and rows are cut off at different places.
  const bool estimates = !picture.compressed && !picture.tiled && !picture.planes && count > 2;
  if (estimates && bytes[0] != bytes[1]) {
    from.refuse(
        fmt::format("the first two strips of the TIFF have {} and {} bytes for the same number of "
                    "rows; save it again",
                    bytes[0], bytes[1]));
  }
}

}  // namespace

std::uint64_t TiffPicture::part_bytes() const {
  const std::uint64_t row_bits = std::uint64_t{part_width} * bits * (planes ? 1 : samples);
  return (row_bits + 7) / 8 * part_height;
}

TiffPicture guard_tiff(ByteSource& bytes, std::vector<ColourPiece>& colours) {
  TiffDirectory directory(bytes);
  TiffPicture picture;
  take_size(directory, picture);
  take_samples(directory, picture);
  take_colours(directory, picture);
  take_coding(directory, picture);
  take_part_size(directory, picture);
  check_parts(directory, picture);
  const TiffField* const profile = directory.find(kIccProfile);
  if (profile != nullptr && profile->data_bytes() > 8 &&
      profile->data_bytes() <= kMostColourBytes) {
    std::vector<std::byte> data;
    directory.at().copy(profile->data, profile->data_bytes(), data);
    add_piece("ICC", data, colours);
  }
  directory.show_used();
  return picture;
}

}  // namespace pounce::io
