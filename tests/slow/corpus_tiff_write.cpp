// SPDX-License-Identifier: Apache-2.0
#include <Imath/half.h>

#include <cmath>
#include <stdexcept>

#include "corpus_tiff.h"
#include "io/codec/sample.h"

namespace pounce::test::corpus {
namespace {

/// Samples as they are in memory and what they are as numbers.
struct Contents {
  std::vector<std::uint64_t> words;  ///< of every sample, texel by texel: its bits
  std::vector<std::uint16_t> palette;
};

std::uint64_t float_word(Random& random, std::uint16_t bits) {
  const double usual = random.one_in(9) ? 0 : random.one_in(5) ? 1 : random.between(-0.5, 2.5);
  const double value = random.one_in(20) ? usual * 1000 : usual;
  std::uint64_t word = 0;
  if (bits == 16) return half(static_cast<float>(value)).bits();
  if (bits == 32) {
    const float narrow = static_cast<float>(value);
    std::memcpy(&word, &narrow, 4);
  } else {
    std::memcpy(&word, &value, 8);
  }
  return word;
}

Contents contents_of(const Tiff& tiff, Random& random) {
  Contents out;
  const std::size_t count = std::size_t{tiff.width} * tiff.height * tiff.samples;
  if (tiff.format == SAMPLEFORMAT_IEEEFP) {
    for (std::size_t i = 0; i < count; ++i) out.words.push_back(float_word(random, tiff.bits));
  } else if (tiff.bits <= 16) {
    for (const std::uint32_t value : whole_values(random, count, (1U << tiff.bits) - 1))
      out.words.push_back(value);
  } else {
    for (std::size_t i = 0; i < count; ++i) out.words.push_back(random.bits() >> (64 - tiff.bits));
  }
  if (tiff.photometric == PHOTOMETRIC_PALETTE) {
    for (std::size_t i = 0; i < std::size_t{3} << tiff.bits; ++i) {
      const std::uint64_t bits = random.bits();
      out.palette.push_back(static_cast<std::uint16_t>(tiff.any_palette ? bits : bits % 256 * 257));
    }
  }
  return out;
}

/// The samples from `first` to `end` of a rectangle, as libtiff takes them: those outside the image
/// are zero.
std::vector<std::uint8_t> block(const Tiff& tiff, const Contents& contents, std::uint32_t x0,
                                std::uint32_t y0, std::uint32_t width, std::uint32_t height,
                                std::uint16_t first, std::uint16_t end) {
  std::vector<std::uint8_t> out;
  for (std::uint32_t y = y0; y < y0 + height; ++y) {
    std::uint32_t held = 0, count = 0;
    for (std::uint32_t x = x0; x < x0 + width; ++x) {
      for (std::uint16_t s = first; s < end; ++s) {
        const bool inside = x < tiff.width && y < tiff.height;
        const std::uint64_t word =
            inside ? contents.words[(std::size_t{y} * tiff.width + x) * tiff.samples + s] : 0;
        if (tiff.bits >= 8) {
          const std::size_t at = out.size();
          out.resize(at + tiff.bits / 8U);
          std::memcpy(out.data() + at, &word, tiff.bits / 8U);
          continue;
        }
        held = held << tiff.bits | static_cast<std::uint32_t>(word);
        count += tiff.bits;
        if (count == 8) {
          out.push_back(static_cast<std::uint8_t>(held));
          held = count = 0;
        }
      }
    }
    if (count > 0) out.push_back(static_cast<std::uint8_t>(held << (8 - count)));
  }
  return out;
}

void check(bool good, const char* what) {
  if (!good) throw std::runtime_error(what);
}

void set_fields(TIFF* file, const Tiff& tiff, const Contents& contents) {
  TIFFSetField(file, TIFFTAG_IMAGEWIDTH, tiff.width);
  TIFFSetField(file, TIFFTAG_IMAGELENGTH, tiff.height);
  TIFFSetField(file, TIFFTAG_BITSPERSAMPLE, tiff.bits);
  TIFFSetField(file, TIFFTAG_SAMPLESPERPIXEL, tiff.samples);
  TIFFSetField(file, TIFFTAG_SAMPLEFORMAT, tiff.format);
  check(TIFFSetField(file, TIFFTAG_COMPRESSION, tiff.compression) != 0, "no such compression");
  TIFFSetField(file, TIFFTAG_PHOTOMETRIC, tiff.photometric);
  TIFFSetField(file, TIFFTAG_PLANARCONFIG,
               tiff.planes ? PLANARCONFIG_SEPARATE : PLANARCONFIG_CONTIG);
  if (tiff.predictor != PREDICTOR_NONE) TIFFSetField(file, TIFFTAG_PREDICTOR, tiff.predictor);
  if (tiff.orientation != 0) TIFFSetField(file, TIFFTAG_ORIENTATION, tiff.orientation);
  if (tiff.fill_order != 0) TIFFSetField(file, TIFFTAG_FILLORDER, tiff.fill_order);
  if (!tiff.extra.empty())
    TIFFSetField(file, TIFFTAG_EXTRASAMPLES, static_cast<int>(tiff.extra.size()),
                 tiff.extra.data());
  if (tiff.subsampling != 0)
    TIFFSetField(file, TIFFTAG_YCBCRSUBSAMPLING, tiff.subsampling, tiff.subsampling);
  if (tiff.compression == COMPRESSION_JPEG && tiff.photometric == PHOTOMETRIC_YCBCR)
    TIFFSetField(file, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
  if (tiff.photometric == PHOTOMETRIC_PALETTE) {
    const std::uint16_t* const map = contents.palette.data();
    const std::size_t size = std::size_t{1} << tiff.bits;
    TIFFSetField(file, TIFFTAG_COLORMAP, map, map + size, map + 2 * size);
  }
  if (tiff.tile_width > 0) {
    TIFFSetField(file, TIFFTAG_TILEWIDTH, tiff.tile_width);
    TIFFSetField(file, TIFFTAG_TILELENGTH, tiff.tile_height);
  } else {
    TIFFSetField(file, TIFFTAG_ROWSPERSTRIP, tiff.rows);
  }
  if (tiff.profile) {
    const std::vector<std::byte> profile = display_p3_profile();
    TIFFSetField(file, TIFFTAG_ICCPROFILE, static_cast<std::uint32_t>(profile.size()),
                 profile.data());
  }
}

/// Of one plane, or of all samples together. Strips and tiles are numbered plane by plane.
void write_plane(TIFF* file, const Tiff& tiff, const Contents& contents, std::uint16_t first,
                 std::uint16_t end, std::uint32_t& number) {
  const bool tiled = tiff.tile_width > 0;
  const std::uint32_t width = tiled ? tiff.tile_width : tiff.width;
  const std::uint32_t rows = tiled ? tiff.tile_height : tiff.rows;
  for (std::uint32_t y = 0; y < tiff.height; y += rows) {
    const std::uint32_t height = tiled ? rows : std::min(rows, tiff.height - y);
    for (std::uint32_t x = 0; x < tiff.width; x += width) {
      std::vector<std::uint8_t> bytes = block(tiff, contents, x, y, width, height, first, end);
      // libtiff 4.5 swaps the bytes first and then takes them for a float's: of what it is given
      // the file holds the swapped ones.
      if (tiff.predictor == PREDICTOR_FLOATINGPOINT && std::string(tiff.mode).ends_with('b')) {
        for (std::size_t i = 0; i < bytes.size(); i += tiff.bits / 8U)
          std::reverse(bytes.data() + i, bytes.data() + i + tiff.bits / 8U);
      }
      const auto size = static_cast<tmsize_t>(bytes.size());
      const tmsize_t done = tiled ? TIFFWriteEncodedTile(file, number, bytes.data(), size)
                                  : TIFFWriteEncodedStrip(file, number, bytes.data(), size);
      check(done >= 0, "libtiff cannot write it");
      ++number;
    }
  }
}

void write_image(TIFF* file, const Tiff& tiff, const Contents& contents) {
  std::uint32_t number = 0;
  if (!tiff.planes) return write_plane(file, tiff, contents, 0, tiff.samples, number);
  for (std::uint16_t s = 0; s < tiff.samples; ++s)
    write_plane(file, tiff, contents, s, static_cast<std::uint16_t>(s + 1), number);
}

void write_file(const Tiff& tiff, const Contents& contents, const std::string& path,
                Random& random) {
  TIFFSetErrorHandler(nullptr);
  TIFFSetWarningHandler(nullptr);
  TIFF* const file = TIFFOpen(path.c_str(), tiff.mode);
  set_fields(file, tiff, contents);
  if (tiff.inside > 0) {
    const std::vector<std::uint64_t> places(static_cast<std::size_t>(tiff.inside), 0);
    TIFFSetField(file, TIFFTAG_SUBIFD, tiff.inside, places.data());
  }
  write_image(file, tiff, contents);
  check(TIFFWriteDirectory(file) != 0, "libtiff cannot write its directory");
  Tiff next = tiff;
  for (int i = 1; i < std::max({tiff.pages, tiff.levels, tiff.inside + 1}); ++i) {
    if (tiff.pages == 1) {
      next.width = std::max(1U, next.width / 2);
      next.height = std::max(1U, next.height / 2);
    }
    const Contents others = contents_of(next, random);
    set_fields(file, next, others);
    TIFFSetField(file, TIFFTAG_SUBFILETYPE, tiff.pages > 1 ? FILETYPE_PAGE : FILETYPE_REDUCEDIMAGE);
    write_image(file, next, others);
    TIFFWriteDirectory(file);
  }
  TIFFClose(file);
}

/// The place of each sample that is inverted, looked up, or neither.
void append_texel(const Tiff& tiff, const Contents& contents, const std::uint64_t* texel,
                  std::vector<std::byte>& out) {
  for (std::uint16_t s = 0; s < tiff.samples; ++s) {
    std::uint64_t word = texel[s];
    if (tiff.photometric == PHOTOMETRIC_PALETTE) {
      for (std::size_t c = 0; c < 3; ++c)
        append(out, static_cast<std::uint8_t>(contents.palette[(c << tiff.bits) + word] / 257));
      continue;
    }
    if (tiff.photometric == PHOTOMETRIC_SEPARATED && s < 3) {
      // Small ones are scaled first.
      const std::uint64_t full = tiff.bits == 16 ? 65535 : 255;
      const std::uint64_t scale = full / ((1ULL << tiff.bits) - 1);
      word = ((full - word * scale) * (full - texel[3] * scale) + full / 2) / full;
      append_scaled(out, static_cast<std::uint32_t>(word), tiff.bits == 16 ? 16 : 8);
      continue;
    }
    if (tiff.photometric == PHOTOMETRIC_SEPARATED && s == 3) continue;
    if (tiff.photometric == PHOTOMETRIC_MINISWHITE && s == 0) word = (1ULL << tiff.bits) - 1 - word;
    if (tiff.format == SAMPLEFORMAT_IEEEFP && tiff.bits == 32)
      append(out, static_cast<std::uint32_t>(word));
    else if (tiff.bits == 16)
      append(out, static_cast<std::uint16_t>(word));
    else
      append_scaled(out, static_cast<std::uint32_t>(word), tiff.bits);
  }
}

bool has_rule(const Tiff& tiff) {
  const bool floats = tiff.format == SAMPLEFORMAT_IEEEFP && (tiff.bits == 16 || tiff.bits == 32);
  const bool whole = tiff.format == SAMPLEFORMAT_UINT && tiff.bits <= 16;
  const bool colours = tiff.photometric <= PHOTOMETRIC_PALETTE ||
                       (tiff.photometric == PHOTOMETRIC_SEPARATED && tiff.samples == 4 && whole);
  const bool inverted_float = tiff.photometric == PHOTOMETRIC_MINISWHITE && !whole;
  return (floats || whole) && colours && !inverted_float && !tiff.any_palette &&
         tiff.compression != COMPRESSION_JPEG && tiff.samples <= 4 &&
         (tiff.photometric != PHOTOMETRIC_PALETTE || tiff.samples == 1);
}

std::optional<Picture> expected(const Tiff& tiff, const Contents& contents) {
  if (!has_rule(tiff)) return std::nullopt;
  Picture out{tiff.width, tiff.height, tiff.samples, Depth::u8, false, {}};
  if (tiff.bits == 32) out.depth = Depth::float32;
  if (tiff.bits == 16) out.depth = tiff.format == SAMPLEFORMAT_IEEEFP ? Depth::half : Depth::u16;
  if (tiff.photometric == PHOTOMETRIC_PALETTE || tiff.photometric == PHOTOMETRIC_SEPARATED)
    out.channels = 3;
  for (std::size_t i = 0; i < contents.words.size(); i += tiff.samples)
    append_texel(tiff, contents, &contents.words[i], out.samples);
  const std::uint16_t last = tiff.extra.empty() ? 0 : tiff.extra.back();
  out.has_alpha = last == EXTRASAMPLE_ASSOCALPHA || last == EXTRASAMPLE_UNASSALPHA;
  if (last == EXTRASAMPLE_ASSOCALPHA)
    io::divide_by_alpha(out.depth, out.channels, std::size_t{out.width} * out.height,
                        out.samples.data());
  return out;
}

}  // namespace

void add(Entries& entries, const std::string& name, const Tiff& tiff) {
  corpus::add(entries, "tiff-" + name + ".tif", [tiff](const std::string& path, Random& random) {
    const Contents contents = contents_of(tiff, random);
    write_file(tiff, contents, path, random);
    return expected(tiff, contents);
  });
}

}  // namespace pounce::test::corpus
