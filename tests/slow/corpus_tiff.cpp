// SPDX-License-Identifier: Apache-2.0
#include "corpus_tiff.h"

#include <fmt/format.h>

#include <array>

namespace pounce::test::corpus {
namespace {

constexpr std::uint16_t kWhole = SAMPLEFORMAT_UINT, kSigned = SAMPLEFORMAT_INT,
                        kFloat = SAMPLEFORMAT_IEEEFP;

struct Numbers {
  const char* name;
  std::uint16_t bits, format;
};
constexpr std::array<Numbers, 12> kNumbers{{{"u1", 1, kWhole},
                                            {"u2", 2, kWhole},
                                            {"u4", 4, kWhole},
                                            {"u8", 8, kWhole},
                                            {"u16", 16, kWhole},
                                            {"u32", 32, kWhole},
                                            {"s8", 8, kSigned},
                                            {"s16", 16, kSigned},
                                            {"s32", 32, kSigned},
                                            {"half", 16, kFloat},
                                            {"float", 32, kFloat},
                                            {"double", 64, kFloat}}};

struct Colours {
  const char* name;
  std::uint16_t photometric, samples;
};

Tiff tiff_of(const Colours& colours, const Numbers& numbers) {
  Tiff tiff;
  tiff.photometric = colours.photometric;
  tiff.samples = colours.samples;
  tiff.bits = numbers.bits;
  tiff.format = numbers.format;
  return tiff;
}

/// Every photometric with every kind of number that libtiff writes, in strips and in tiles.
void add_photometrics(Entries& entries) {
  constexpr std::array<Colours, 9> kColours{{{"black", PHOTOMETRIC_MINISBLACK, 1},
                                             {"white", PHOTOMETRIC_MINISWHITE, 1},
                                             {"rgb", PHOTOMETRIC_RGB, 3},
                                             {"palette", PHOTOMETRIC_PALETTE, 1},
                                             {"cmyk", PHOTOMETRIC_SEPARATED, 4},
                                             {"ycbcr", PHOTOMETRIC_YCBCR, 3},
                                             {"lab", PHOTOMETRIC_CIELAB, 3},
                                             {"icclab", PHOTOMETRIC_ICCLAB, 3},
                                             {"mask", PHOTOMETRIC_MASK, 1}}};
  for (const Colours& colours : kColours) {
    for (const Numbers& numbers : kNumbers) {
      const bool small_only = colours.photometric == PHOTOMETRIC_PALETTE;
      const bool bytes_only = colours.photometric == PHOTOMETRIC_YCBCR ||
                              colours.photometric == PHOTOMETRIC_CIELAB ||
                              colours.photometric == PHOTOMETRIC_ICCLAB;
      if (small_only && (numbers.bits > 8 || numbers.format != kWhole)) continue;
      if (bytes_only && numbers.bits != 8 && numbers.bits != 16) continue;
      if (colours.photometric == PHOTOMETRIC_MASK && numbers.bits > 8) continue;
      Tiff tiff = tiff_of(colours, numbers);
      if (colours.photometric == PHOTOMETRIC_YCBCR) tiff.subsampling = 1;
      add(entries, fmt::format("{}-{}", colours.name, numbers.name), tiff);
      tiff.tile_width = 32;
      tiff.tile_height = 16;
      add(entries, fmt::format("{}-{}-tiles", colours.name, numbers.name), tiff);
      if (colours.samples == 1 || numbers.format != kWhole || numbers.bits < 8) continue;
      tiff.planes = true;
      add(entries, fmt::format("{}-{}-planes-tiles", colours.name, numbers.name), tiff);
      tiff.tile_width = tiff.tile_height = 0;
      add(entries, fmt::format("{}-{}-planes", colours.name, numbers.name), tiff);
    }
  }
}

void add_extra_samples(Entries& entries) {
  struct Extra {
    const char* name;
    std::vector<std::uint16_t> kinds;
  };
  const std::vector<Extra> extras{{"unsaid", {}},
                                  {"other", {EXTRASAMPLE_UNSPECIFIED}},
                                  {"associated", {EXTRASAMPLE_ASSOCALPHA}},
                                  {"unassociated", {EXTRASAMPLE_UNASSALPHA}}};
  for (const Colours& colours :
       {Colours{"grey", PHOTOMETRIC_MINISBLACK, 2}, Colours{"rgb", PHOTOMETRIC_RGB, 4}}) {
    for (const char* kind : {"u8", "u16", "half", "float"}) {
      const Numbers numbers =
          *std::find_if(kNumbers.begin(), kNumbers.end(),
                        [&](const Numbers& n) { return std::string(n.name) == kind; });
      for (const Extra& extra : extras) {
        Tiff tiff = tiff_of(colours, numbers);
        tiff.extra = extra.kinds;
        const std::string name = fmt::format("{}-{}-{}", colours.name, kind, extra.name);
        add(entries, name, tiff);
        tiff.planes = true;
        add(entries, name + "-planes", tiff);
        tiff.tile_width = tiff.tile_height = 16;
        add(entries, name + "-planes-tiles", tiff);
        tiff.planes = false;
        add(entries, name + "-tiles", tiff);
      }
    }
  }
  Tiff more = tiff_of({"", PHOTOMETRIC_RGB, 5}, {"", 8, kWhole});
  more.extra = {EXTRASAMPLE_UNASSALPHA, EXTRASAMPLE_UNSPECIFIED};
  add(entries, "rgb-alpha-and-more", more);
  more.extra = {EXTRASAMPLE_UNSPECIFIED, EXTRASAMPLE_ASSOCALPHA};
  add(entries, "rgb-more-and-alpha", more);
  more.samples = 8;
  more.extra = {0, 0, 0, 0, 0};
  add(entries, "rgb-five-more", more);
  more.photometric = PHOTOMETRIC_MINISBLACK;
  more.samples = 3;
  more.extra = {0, 0};
  add(entries, "grey-two-more", more);
  more.extra = {};
  add(entries, "grey-two-more-unsaid", more);
  more.photometric = PHOTOMETRIC_SEPARATED;
  more.samples = 5;
  more.extra = {EXTRASAMPLE_UNASSALPHA};
  add(entries, "cmyk-alpha", more);
  more.photometric = PHOTOMETRIC_PALETTE;
  more.samples = 2;
  add(entries, "palette-alpha", more);
}

void add_sizes(Entries& entries) {
  struct Size {
    std::uint32_t width, height;
  };
  for (const Size& size : {Size{1, 1}, Size{7, 5}, Size{513, 3}, Size{3, 300}}) {
    for (const Colours& colours :
         {Colours{"rgb", PHOTOMETRIC_RGB, 3}, Colours{"palette", PHOTOMETRIC_PALETTE, 1},
          Colours{"white", PHOTOMETRIC_MINISWHITE, 1}}) {
      Tiff tiff = tiff_of(colours, kNumbers[colours.samples == 3 ? 4 : 0]);
      tiff.width = size.width;
      tiff.height = size.height;
      add(entries, fmt::format("{}-{}x{}", colours.name, size.width, size.height), tiff);
    }
  }
  for (const std::uint32_t rows : {1U, 3U, 16U, 29U}) {
    for (const bool planes : {false, true}) {
      Tiff tiff = tiff_of({"", PHOTOMETRIC_RGB, 3}, kNumbers[3]);
      tiff.rows = rows;
      tiff.planes = planes;
      add(entries, fmt::format("strips-of-{}{}", rows, planes ? "-planes" : ""), tiff);
    }
  }
  constexpr std::array<std::uint16_t, 4> kCodings{COMPRESSION_NONE, COMPRESSION_LZW,
                                                  COMPRESSION_ADOBE_DEFLATE, COMPRESSION_PACKBITS};
  for (const std::uint16_t coding : kCodings) {
    for (const std::uint32_t rows : {70U, 200U}) {
      Tiff tiff = tiff_of({"", PHOTOMETRIC_RGB, 3}, kNumbers[4]);
      tiff.width = 50;
      tiff.height = 200;
      tiff.rows = rows;
      tiff.compression = coding;
      add(entries, fmt::format("high-strips-of-{}-coding-{}", rows, coding), tiff);
    }
  }
  for (const Size& tile : {Size{16, 16}, Size{64, 32}, Size{16, 256}, Size{256, 256}}) {
    for (const bool planes : {false, true}) {
      for (const std::uint16_t bits : {std::uint16_t{8}, std::uint16_t{16}}) {
        Tiff tiff = tiff_of({"", PHOTOMETRIC_RGB, 3}, {"", bits, kWhole});
        tiff.width = 101;
        tiff.height = 47;
        tiff.tile_width = tile.width;
        tiff.tile_height = tile.height;
        tiff.planes = planes;
        tiff.compression = COMPRESSION_LZW;
        add(entries,
            fmt::format("tiles-of-{}x{}-u{}{}", tile.width, tile.height, bits,
                        planes ? "-planes" : ""),
            tiff);
      }
    }
  }
}

}  // namespace

void add_tiff(Entries& entries) {
  add_photometrics(entries);
  add_extra_samples(entries);
  add_sizes(entries);
  add_tiff_codings(entries);
}

}  // namespace pounce::test::corpus
