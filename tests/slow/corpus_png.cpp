// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "corpus.h"

namespace pounce::test::corpus {
namespace {

enum class Clear { none, key, palette };

struct Png {
  std::uint32_t width = 7, height = 5;
  std::uint32_t bits = 8;
  int type = PNG_COLOR_TYPE_GRAY;
  Clear clear = Clear::none;
  bool interlaced = false;
  int filters = PNG_ALL_FILTERS;
  std::size_t idat_bytes = 0;  ///< 0: libpng's usual
  int level = 6;
  std::string chunk = {};  ///< one more, of this name
};

std::uint32_t samples_of(int type) {
  return type == PNG_COLOR_TYPE_GRAY || type == PNG_COLOR_TYPE_PALETTE ? 1
         : type == PNG_COLOR_TYPE_GRAY_ALPHA                           ? 2
         : type == PNG_COLOR_TYPE_RGB                                  ? 3
                                                                       : 4;
}

/// What a file holds beside its header.
struct Contents {
  std::vector<std::uint32_t> values;
  std::vector<png_color> palette;
  std::vector<png_byte> clear;  ///< of the palette's entries; may be shorter than it
  std::array<std::uint32_t, 3> key{};
};

Contents contents_of(const Png& png, Random& random) {
  Contents out;
  const std::uint32_t largest = (1U << png.bits) - 1;
  const std::uint32_t samples = samples_of(png.type);
  out.values = whole_values(random, std::size_t{png.width} * png.height * samples, largest);
  if (png.type == PNG_COLOR_TYPE_PALETTE) {
    for (std::uint32_t i = 0; i <= largest; ++i) {
      const std::uint64_t bits = random.bits();
      out.palette.push_back({static_cast<png_byte>(bits), static_cast<png_byte>(bits >> 8),
                             static_cast<png_byte>(bits >> 16)});
      if (png.clear == Clear::palette && i < std::max(1U, largest * 3 / 4))
        out.clear.push_back(static_cast<png_byte>(i % 3 == 0 ? 0 : bits >> 24));
    }
  }
  if (png.clear == Clear::key) {  // that of a texel, so that there is one
    const std::size_t texel = random.below(std::uint64_t{png.width} * png.height);
    for (std::uint32_t c = 0; c < samples; ++c) out.key[c] = out.values[texel * samples + c];
  }
  return out;
}

Picture expected(const Png& png, const Contents& contents) {
  Picture out{png.width, png.height, samples_of(png.type), Depth::u8, false, {}};
  const std::uint32_t samples = out.channels;
  if (png.bits == 16) out.depth = Depth::u16;
  out.has_alpha = (png.type & PNG_COLOR_MASK_ALPHA) != 0 || png.clear != Clear::none;
  const bool palette = png.type == PNG_COLOR_TYPE_PALETTE;
  if (palette) out.channels = 3;
  if (png.clear != Clear::none) ++out.channels;
  for (std::size_t i = 0; i < contents.values.size(); i += samples) {
    const std::uint32_t* const texel = &contents.values[i];
    if (palette) {
      const png_color colour = contents.palette[*texel];
      for (const png_byte sample : {colour.red, colour.green, colour.blue})
        append(out.samples, sample);
      if (png.clear == Clear::palette)
        append(out.samples,
               *texel < contents.clear.size() ? contents.clear[*texel] : png_byte{255});
      continue;
    }
    for (std::uint32_t c = 0; c < samples; ++c) append_scaled(out.samples, texel[c], png.bits);
    if (png.clear == Clear::key) {
      const bool clear = std::equal(texel, texel + samples, contents.key.begin());
      append_scaled(out.samples, clear ? 0 : (1U << png.bits) - 1, png.bits);
    }
  }
  return out;
}

void write_chunk(png_structp png, const char* name, const std::vector<png_byte>& data) {
  png_write_chunk(png, reinterpret_cast<png_const_bytep>(name), data.data(), data.size());
}

/// Those that libpng writes by itself.
void set_chunk(png_structp png, png_infop info, const std::string& chunk) {
  if (chunk == "gAMA 2.2") png_set_gAMA(png, info, 1 / 2.2);
  if (chunk == "gAMA 1") png_set_gAMA(png, info, 1.0);
  if (chunk == "sRGB") png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_RELATIVE);
  if (chunk == "cHRM") png_set_cHRM(png, info, 0.3127, 0.3290, 0.68, 0.32, 0.265, 0.69, 0.15, 0.06);
  if (chunk == "bKGD") {
    png_color_16 colour{1, 2, 3, 4, 5};
    png_set_bKGD(png, info, &colour);
  }
  if (chunk == "sBIT") {
    png_color_8 bits{5, 6, 5, 5, 5};
    png_set_sBIT(png, info, &bits);
  }
  if (chunk == "tIME") {
    png_time time{2024, 2, 29, 12, 30, 60};
    png_set_tIME(png, info, &time);
  }
  if (chunk == "pHYs") png_set_pHYs(png, info, 2835, 5000, PNG_RESOLUTION_METER);
  if (chunk == "iCCP") {
    const std::vector<std::byte> profile = display_p3_profile();
    png_set_iCCP(png, info, "P3", PNG_COMPRESSION_TYPE_BASE,
                 reinterpret_cast<png_const_bytep>(profile.data()),
                 static_cast<png_uint_32>(profile.size()));
  }
  const bool text = chunk == "tEXt" || chunk == "zTXt" || chunk == "iTXt";
  if (text) {
    std::string key = "Comment", words(300, 'x');
    png_text said{};
    said.compression = chunk == "tEXt"   ? PNG_TEXT_COMPRESSION_NONE
                       : chunk == "zTXt" ? PNG_TEXT_COMPRESSION_zTXt
                                         : PNG_ITXT_COMPRESSION_zTXt;
    said.key = key.data();
    said.text = words.data();
    png_set_text(png, info, &said, 1);
  }
}

void set_up(png_structp writer, png_infop info, const Png& png, const Contents& contents) {
  png_set_IHDR(writer, info, png.width, png.height, static_cast<int>(png.bits), png.type,
               png.interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_BASE,
               PNG_FILTER_TYPE_BASE);
  png_set_filter(writer, PNG_FILTER_TYPE_BASE, png.filters);
  png_set_compression_level(writer, png.level);
  if (png.idat_bytes > 0) png_set_compression_buffer_size(writer, png.idat_bytes);
  if (!contents.palette.empty())
    png_set_PLTE(writer, info, contents.palette.data(), static_cast<int>(contents.palette.size()));
  if (png.clear == Clear::palette)
    png_set_tRNS(writer, info, contents.clear.data(), static_cast<int>(contents.clear.size()),
                 nullptr);
  if (png.clear == Clear::key) {
    const auto key = [&](std::size_t c) { return static_cast<png_uint_16>(contents.key[c]); };
    png_color_16 colour{0, key(0), key(1), key(2), key(0)};
    png_set_tRNS(writer, info, nullptr, 0, &colour);
  }
  set_chunk(writer, info, png.chunk);
  png_write_info_before_PLTE(writer, info);
  // Colour primaries P3, transfer sRGB's, RGB, full range.
  if (png.chunk == "cICP") write_chunk(writer, "cICP", {12, 13, 0, 1});
  if (png.chunk == "unknown") write_chunk(writer, "xyZz", {1, 2, 3});
  png_write_info(writer, info);
}

std::optional<Picture> write(const Png& png, const std::string& path, Random& random) {
  const Contents contents = contents_of(png, random);
  FILE* const file = std::fopen(path.c_str(), "wb");
  png_structp writer = png_create_write_struct(
      PNG_LIBPNG_VER_STRING, nullptr,
      [](png_structp, png_const_charp why) { throw std::runtime_error(why); },
      [](png_structp, png_const_charp) {});
  png_infop info = png_create_info_struct(writer);
  png_init_io(writer, file);
  set_up(writer, info, png, contents);
  const std::size_t per_row = std::size_t{png.width} * samples_of(png.type);
  std::vector<std::uint8_t> rows = packed(contents.values, per_row, png.bits);
  std::vector<png_bytep> places;
  for (std::uint32_t y = 0; y < png.height; ++y)
    places.push_back(rows.data() + y * (rows.size() / png.height));
  png_write_image(writer, places.data());
  png_write_end(writer, info);
  png_destroy_write_struct(&writer, &info);
  std::fclose(file);
  return expected(png, contents);
}

void add(Entries& entries, const std::string& name, const Png& png) {
  corpus::add(entries, "png-" + name + ".png",
              [png](const std::string& path, Random& random) { return write(png, path, random); });
}

struct Kind {
  const char* name;
  int type;
  std::vector<std::uint32_t> bits;
  Clear clear = Clear::none;
};

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all{
      {"grey", PNG_COLOR_TYPE_GRAY, {1, 2, 4, 8, 16}},
      {"grey-alpha", PNG_COLOR_TYPE_GRAY_ALPHA, {8, 16}},
      {"rgb", PNG_COLOR_TYPE_RGB, {8, 16}},
      {"rgba", PNG_COLOR_TYPE_RGB_ALPHA, {8, 16}},
      {"palette", PNG_COLOR_TYPE_PALETTE, {1, 2, 4, 8}},
      {"palette-clear", PNG_COLOR_TYPE_PALETTE, {1, 2, 4, 8}, Clear::palette},
      {"grey-key", PNG_COLOR_TYPE_GRAY, {1, 2, 4, 8, 16}, Clear::key},
      {"rgb-key", PNG_COLOR_TYPE_RGB, {8, 16}, Clear::key}};
  return all;
}

void add_kinds(Entries& entries) {
  constexpr std::array<std::array<std::uint32_t, 2>, 3> kSizes{{{1, 1}, {7, 5}, {513, 3}}};
  for (const Kind& kind : kinds()) {
    for (const std::uint32_t bits : kind.bits) {
      for (const auto& [width, height] : kSizes) {
        for (const bool interlaced : {false, true}) {
          Png png{width, height, bits, kind.type, kind.clear, interlaced};
          add(entries,
              fmt::format("{}{}-{}x{}{}", kind.name, bits, width, height,
                          interlaced ? "-interlaced" : ""),
              png);
        }
      }
    }
  }
}

void add_filters(Entries& entries) {
  struct Filter {
    const char* name;
    int filter;
  };
  for (const Filter& filter :
       {Filter{"none", PNG_FILTER_NONE}, Filter{"sub", PNG_FILTER_SUB}, Filter{"up", PNG_FILTER_UP},
        Filter{"average", PNG_FILTER_AVG}, Filter{"paeth", PNG_FILTER_PAETH}}) {
    Png png{61, 70, 8, PNG_COLOR_TYPE_RGB};
    png.filters = filter.filter;
    add(entries, fmt::format("filter-{}-rgb8", filter.name), png);
    png.type = PNG_COLOR_TYPE_RGB_ALPHA;
    png.bits = 16;
    add(entries, fmt::format("filter-{}-rgba16", filter.name), png);
    png.type = PNG_COLOR_TYPE_GRAY;
    png.bits = 2;
    png.interlaced = true;
    add(entries, fmt::format("filter-{}-grey2-interlaced", filter.name), png);
  }
}

}  // namespace

void add_png(Entries& entries) {
  add_kinds(entries);
  add_filters(entries);
  Png png{150, 130, 8, PNG_COLOR_TYPE_RGB};
  for (const std::size_t bytes : {6, 100, 8192, 1000000}) {
    png.idat_bytes = bytes;
    add(entries, fmt::format("idat-{}", bytes), png);
  }
  png.idat_bytes = 0;
  for (const int level : {0, 1, 9}) {
    png.level = level;
    add(entries, fmt::format("level-{}", level), png);
  }
  for (const bool wide : {false, true}) {
    for (const char* chunk : {"gAMA 2.2", "gAMA 1", "sRGB", "cHRM", "iCCP", "cICP", "tEXt", "zTXt",
                              "iTXt", "bKGD", "sBIT", "tIME", "pHYs", "unknown"}) {
      Png one{20, 9, wide ? 16U : 8U, wide ? PNG_COLOR_TYPE_RGB_ALPHA : PNG_COLOR_TYPE_RGB};
      one.chunk = chunk;
      std::string name = chunk;
      std::replace(name.begin(), name.end(), ' ', '-');
      add(entries, fmt::format("chunk-{}-{}", name, wide ? "rgba16" : "rgb8"), one);
    }
  }
}

}  // namespace pounce::test::corpus
