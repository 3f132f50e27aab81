// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>

#include "corpus_tiff.h"

namespace pounce::test::corpus {
namespace {

struct Kind {
  const char* name;
  std::uint16_t photometric, samples, bits, format;
  std::vector<std::uint16_t> extra = {};
};

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all{
      {"grey1", PHOTOMETRIC_MINISBLACK, 1, 1, SAMPLEFORMAT_UINT},
      {"grey8", PHOTOMETRIC_MINISBLACK, 1, 8, SAMPLEFORMAT_UINT},
      {"rgb8", PHOTOMETRIC_RGB, 3, 8, SAMPLEFORMAT_UINT},
      {"rgba16", PHOTOMETRIC_RGB, 4, 16, SAMPLEFORMAT_UINT, {EXTRASAMPLE_UNASSALPHA}},
      {"palette4", PHOTOMETRIC_PALETTE, 1, 4, SAMPLEFORMAT_UINT},
      {"rgbhalf", PHOTOMETRIC_RGB, 3, 16, SAMPLEFORMAT_IEEEFP},
      {"rgbfloat", PHOTOMETRIC_RGB, 3, 32, SAMPLEFORMAT_IEEEFP}};
  return all;
}

Tiff tiff_of(const Kind& kind) {
  Tiff tiff;
  tiff.photometric = kind.photometric;
  tiff.samples = kind.samples;
  tiff.bits = kind.bits;
  tiff.format = kind.format;
  tiff.extra = kind.extra;
  return tiff;
}

struct Coding {
  const char* name;
  std::uint16_t compression, predictor;
};
constexpr std::array<Coding, 14> kCodings{{{"none", COMPRESSION_NONE, 1},
                                           {"packbits", COMPRESSION_PACKBITS, 1},
                                           {"lzw", COMPRESSION_LZW, 1},
                                           {"lzw-2", COMPRESSION_LZW, 2},
                                           {"lzw-3", COMPRESSION_LZW, 3},
                                           {"zip", COMPRESSION_ADOBE_DEFLATE, 1},
                                           {"zip-2", COMPRESSION_ADOBE_DEFLATE, 2},
                                           {"zip-3", COMPRESSION_ADOBE_DEFLATE, 3},
                                           {"oldzip-2", COMPRESSION_DEFLATE, 2},
                                           {"zstd", COMPRESSION_ZSTD, 1},
                                           {"zstd-2", COMPRESSION_ZSTD, 2},
                                           {"zstd-3", COMPRESSION_ZSTD, 3},
                                           {"lzma", COMPRESSION_LZMA, 1},
                                           {"lzma-2", COMPRESSION_LZMA, 2}}};

bool fits(const Kind& kind, const Coding& coding) {
  if (coding.predictor == 2 && (kind.bits < 8 || kind.format == SAMPLEFORMAT_IEEEFP)) return false;
  return coding.predictor != 3 || kind.format == SAMPLEFORMAT_IEEEFP;
}

void add_compressions(Entries& entries) {
  for (const Kind& kind : kinds()) {
    for (const Coding& coding : kCodings) {
      if (!fits(kind, coding)) continue;
      Tiff tiff = tiff_of(kind);
      tiff.compression = coding.compression;
      tiff.predictor = coding.predictor;
      const std::string name = fmt::format("{}-{}", coding.name, kind.name);
      add(entries, name, tiff);
      tiff.tile_width = tiff.tile_height = 16;
      add(entries, name + "-tiles", tiff);
      if (tiff.samples == 1) continue;
      tiff.planes = true;
      add(entries, name + "-planes-tiles", tiff);
      tiff.tile_width = tiff.tile_height = 0;
      add(entries, name + "-planes", tiff);
    }
  }
}

void add_fax_and_jpeg(Entries& entries) {
  constexpr std::array<std::uint16_t, 2> kGreys{PHOTOMETRIC_MINISBLACK, PHOTOMETRIC_MINISWHITE};
  for (const Coding& coding :
       {Coding{"ccitt-rle", COMPRESSION_CCITTRLE, 1}, Coding{"ccitt-g3", COMPRESSION_CCITTFAX3, 1},
        Coding{"ccitt-g4", COMPRESSION_CCITTFAX4, 1}}) {
    for (const std::uint16_t photometric : kGreys) {
      Tiff tiff;
      tiff.photometric = photometric;
      tiff.bits = 1;
      tiff.compression = coding.compression;
      const char* const colours = photometric == PHOTOMETRIC_MINISWHITE ? "white" : "black";
      add(entries, fmt::format("{}-{}", coding.name, colours), tiff);
      tiff.fill_order = FILLORDER_LSB2MSB;
      add(entries, fmt::format("{}-{}-lsb", coding.name, colours), tiff);
    }
  }
  for (const Kind& kind : {Kind{"grey", PHOTOMETRIC_MINISBLACK, 1, 8, SAMPLEFORMAT_UINT},
                           Kind{"rgb", PHOTOMETRIC_RGB, 3, 8, SAMPLEFORMAT_UINT},
                           Kind{"ycbcr", PHOTOMETRIC_YCBCR, 3, 8, SAMPLEFORMAT_UINT},
                           Kind{"cmyk", PHOTOMETRIC_SEPARATED, 4, 8, SAMPLEFORMAT_UINT}}) {
    Tiff tiff = tiff_of(kind);
    tiff.width = 64;
    tiff.height = 48;
    tiff.rows = 16;
    tiff.compression = COMPRESSION_JPEG;
    add(entries, fmt::format("jpeg-{}", kind.name), tiff);
    tiff.tile_width = tiff.tile_height = 32;
    add(entries, fmt::format("jpeg-{}-tiles", kind.name), tiff);
  }
}

void add_orders(Entries& entries) {
  struct Order {
    const char *name, *mode;
  };
  for (const Order& order : {Order{"little", "wl"}, Order{"big", "wb"}, Order{"little-big", "w8l"},
                             Order{"big-big", "w8b"}}) {
    for (const Kind& kind : kinds()) {
      Tiff tiff = tiff_of(kind);
      tiff.mode = order.mode;
      add(entries, fmt::format("order-{}-{}", order.name, kind.name), tiff);
      tiff.compression = COMPRESSION_LZW;
      if (kind.format == SAMPLEFORMAT_IEEEFP) tiff.predictor = 3;
      if (kind.format == SAMPLEFORMAT_UINT && kind.bits >= 8) tiff.predictor = 2;
      add(entries, fmt::format("order-{}-{}-lzw", order.name, kind.name), tiff);
    }
  }
  for (const Kind& kind : {kinds()[0], kinds()[2], kinds()[4]}) {
    Tiff tiff = tiff_of(kind);
    tiff.fill_order = FILLORDER_LSB2MSB;
    add(entries, fmt::format("lsb-{}", kind.name), tiff);
    tiff.compression = COMPRESSION_PACKBITS;
    add(entries, fmt::format("lsb-{}-packbits", kind.name), tiff);
  }
}

void add_directories(Entries& entries) {
  Tiff tiff = tiff_of(kinds()[2]);
  for (std::uint16_t orientation = 1; orientation <= 8; ++orientation) {
    tiff.orientation = orientation;
    add(entries, fmt::format("orientation-{}", orientation), tiff);
  }
  tiff.orientation = 0;
  tiff.pages = 3;
  add(entries, "pages", tiff);
  tiff.pages = 1;
  tiff.inside = 2;
  add(entries, "sub-images", tiff);
  tiff.inside = 0;
  tiff.levels = 6;
  add(entries, "levels", tiff);
  tiff.tile_width = tiff.tile_height = 16;
  add(entries, "levels-tiles", tiff);
  tiff = tiff_of(kinds()[2]);
  tiff.profile = true;
  add(entries, "profile", tiff);
  tiff = tiff_of(kinds()[4]);
  tiff.any_palette = true;
  add(entries, "palette-of-16-bits", tiff);
}

}  // namespace

void add_tiff_codings(Entries& entries) {
  add_compressions(entries);
  add_fax_and_jpeg(entries);
  add_orders(entries);
  add_directories(entries);
}

}  // namespace pounce::test::corpus
