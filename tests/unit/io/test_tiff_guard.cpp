// SPDX-License-Identifier: Apache-2.0
//
// TIFFs made by hand: every combination that is read gives the samples that were put in, and what
// is not on the list is refused with what to do.
#include <zlib.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "core/portable_math.h"
#include "pounce/error.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Contains;
using test::in_memory;

namespace {

using Values = std::vector<std::uint64_t>;

enum class Coding { none = 1, lzw = 5, deflate = 8, pack_bits = 32773 };

/// One picture and how it is stored.
struct Layout {
  std::uint32_t width = 37, height = 21;
  std::uint32_t photometric = 2, samples = 3, bits = 8;
  bool floats = false, planes = false, tiled = false, big_endian = false;
  Coding coding = Coding::none;
  std::uint32_t predictor = 1;
  Values extra;
};

/// Numbers in the layout's byte order.
std::string number(const Layout& layout, std::uint64_t n, int size) {
  std::string out;
  for (int i = 0; i < size; ++i)
    out += static_cast<char>(n >> 8 * (layout.big_endian ? size - 1 - i : i));
  return out;
}

std::uint32_t sample_at(const Layout& layout, std::uint32_t x, std::uint32_t y, std::uint32_t s) {
  const std::uint32_t noise = (x * 2654435761U + y * 40503U + s * 97U) >> 7;
  if (layout.floats) {
    const float value = static_cast<float>(noise % 512) / 16;
    std::uint32_t bits = 0;
    if (layout.bits == 16) return float_to_half(value);
    std::memcpy(&bits, &value, 4);
    return bits;
  }
  return noise & ((1U << layout.bits) - 1);
}

/// The colour of a palette's entry: red, green or blue.
std::uint32_t palette_at(std::uint32_t entry, std::uint32_t channel) {
  return (entry * 53 + channel * 91 + 7) % 256;
}

/// Codes of nine bits, a clear code in time.
std::string lzw(const std::string& plain) {
  std::string out;
  std::uint32_t held = 0;
  int bits = 0;
  const auto put = [&](std::uint32_t code) {
    held = held << 9 | code;
    for (bits += 9; bits >= 8; bits -= 8) out += static_cast<char>(held >> (bits - 8));
  };
  for (std::size_t i = 0; i < plain.size(); ++i) {
    if (i % 200 == 0) put(256);
    put(static_cast<std::uint8_t>(plain[i]));
  }
  put(257);
  if (bits > 0) out += static_cast<char>(held << (8 - bits));
  return out;
}

std::string coded(const Layout& layout, const std::string& plain, std::size_t row_bytes) {
  if (layout.coding == Coding::none) return plain;
  if (layout.coding == Coding::lzw) return lzw(plain);
  std::string out;
  if (layout.coding == Coding::pack_bits) {  // a row is packed by itself
    for (std::size_t row = 0; row < plain.size(); row += row_bytes) {
      for (std::size_t i = row; i < row + row_bytes; i += 100) {
        const std::string piece = plain.substr(i, std::min<std::size_t>(100, row + row_bytes - i));
        out += static_cast<char>(piece.size() - 1);
        out += piece;
      }
    }
    return out;
  }
  uLongf size = ::compressBound(plain.size());
  out.resize(size);
  ::compress(reinterpret_cast<Bytef*>(out.data()), &size,
             reinterpret_cast<const Bytef*>(plain.data()), plain.size());
  out.resize(size);
  return out;
}

/// A row of a strip or a tile, of `channels` samples from `first` on.
std::string packed_row(const Layout& layout, std::uint32_t begin, std::uint32_t width,
                       std::uint32_t y, std::uint32_t first, std::uint32_t channels) {
  std::vector<std::uint32_t> samples;
  for (std::uint32_t x = begin; x < begin + width; ++x) {
    for (std::uint32_t s = first; s < first + channels; ++s)
      samples.push_back(x < layout.width && y < layout.height ? sample_at(layout, x, y, s) : 0);
  }
  if (layout.predictor == 2) {
    for (std::size_t i = samples.size(); i-- > channels;) samples[i] -= samples[i - channels];
  }
  std::string out;
  if (layout.bits < 8) {
    std::uint32_t held = 0, bits = 0;
    for (const std::uint32_t sample : samples) {
      held = held << layout.bits | sample;
      bits += layout.bits;
      if (bits == 8) out += static_cast<char>(held), bits = 0;
    }
    if (bits > 0) out += static_cast<char>(held << (8 - bits));
    return out;
  }
  for (const std::uint32_t sample : samples)
    out += number(layout, sample, static_cast<int>(layout.bits / 8));
  if (layout.predictor == 3) {  // the highest bytes first, then differences
    const std::size_t size = layout.bits / 8;
    std::string planes(out.size(), '\0');
    for (std::size_t i = 0; i < samples.size(); ++i) {
      for (std::size_t b = 0; b < size; ++b) {
        const std::size_t from = layout.big_endian ? b : size - 1 - b;
        planes[b * samples.size() + i] = out[i * size + from];
      }
    }
    for (std::size_t i = planes.size(); i-- > channels;)
      planes[i] = static_cast<char>(planes[i] - planes[i - channels]);
    return planes;
  }
  return out;
}

struct Entry {
  int type = 3;
  Values values;
};
using Entries = std::map<int, Entry>;

/// The file, after `change` had its way with the directory.
template <class Change>
std::string tiff(const Layout& layout, Change change) {
  constexpr std::uint32_t kRows = 8, kTile = 16;
  std::string out = layout.big_endian ? std::string("MM\0*", 4) : std::string("II*\0", 4);
  out += std::string(4, '\0');
  Entries entries;
  const std::uint32_t width = layout.tiled ? kTile : layout.width;
  const std::uint32_t height = layout.tiled ? kTile : kRows;
  Values places, sizes;
  for (std::uint32_t plane = 0; plane < (layout.planes ? layout.samples : 1); ++plane) {
    for (std::uint32_t y = 0; y < layout.height; y += height) {
      for (std::uint32_t x = 0; x < layout.width; x += width) {
        std::string part;
        const std::uint32_t rows = layout.tiled ? height : std::min(height, layout.height - y);
        for (std::uint32_t row = y; row < y + rows; ++row) {
          part += packed_row(layout, x, width, row, plane, layout.planes ? 1 : layout.samples);
        }
        part = coded(layout, part, part.size() / rows);
        places.push_back(out.size());
        sizes.push_back(part.size());
        out += part + (part.size() % 2 == 1 ? "x" : "");
      }
    }
  }
  entries[256] = {4, {layout.width}};
  entries[257] = {4, {layout.height}};
  entries[258] = {3, Values(layout.samples, layout.bits)};
  entries[259] = {3, {static_cast<std::uint64_t>(layout.coding)}};
  entries[262] = {3, {layout.photometric}};
  entries[277] = {3, {layout.samples}};
  entries[284] = {3, {layout.planes ? 2ULL : 1ULL}};
  if (layout.predictor != 1) entries[317] = {3, {layout.predictor}};
  if (layout.photometric == 3) {
    for (std::uint32_t c = 0; c < 3; ++c) {
      for (std::uint32_t i = 0; i < 1U << layout.bits; ++i)
        entries[320].values.push_back(palette_at(i, c) * 257);
    }
  }
  if (!layout.extra.empty()) entries[338] = {3, layout.extra};
  entries[339] = {3, Values(layout.samples, layout.floats ? 3 : 1)};
  if (layout.tiled) {
    entries[322] = entries[323] = {3, {kTile}};
    entries[324] = {4, places};
    entries[325] = {4, sizes};
  } else {
    entries[278] = {3, {kRows}};
    entries[273] = {4, places};
    entries[279] = {4, sizes};
  }
  change(entries);
  std::string directory = number(layout, entries.size(), 2);
  for (const auto& [tag, entry] : entries) {
    const int size = entry.type == 3 ? 2 : entry.type == 4 ? 4 : 1;
    std::string values;
    for (const std::uint64_t value : entry.values) values += number(layout, value, size);
    directory += number(layout, static_cast<std::uint64_t>(tag), 2) +
                 number(layout, static_cast<std::uint64_t>(entry.type), 2) +
                 number(layout, entry.values.size(), 4);
    if (values.size() <= 4) {
      directory += values + std::string(4 - values.size(), '\0');
    } else {
      directory += number(layout, out.size(), 4);
      out += values + (values.size() % 2 == 1 ? "x" : "");
    }
  }
  out.replace(4, 4, number(layout, out.size(), 4));
  return out + directory + std::string(4, '\0');
}
std::string tiff(const Layout& layout) {
  return tiff(layout, [](Entries&) {});
}

/// What reading must give: the machine's byte order, palettes and small samples as 8 bits.
std::vector<std::uint8_t> expected(const Layout& layout) {
  std::vector<std::uint8_t> out;
  for (std::uint32_t y = 0; y < layout.height; ++y) {
    for (std::uint32_t x = 0; x < layout.width; ++x) {
      if (layout.photometric == 3) {
        for (std::uint32_t c = 0; c < 3; ++c)
          out.push_back(static_cast<std::uint8_t>(palette_at(sample_at(layout, x, y, 0), c)));
        continue;
      }
      if (layout.photometric == 5) {  // what four inks leave of white
        const std::uint64_t full = (1ULL << layout.bits) - 1;
        for (std::uint32_t c = 0; c < 3; ++c) {
          const std::uint64_t left =
              (full - sample_at(layout, x, y, c)) * (full - sample_at(layout, x, y, 3));
          const std::uint64_t sample = (left + full / 2) / full;
          for (std::uint32_t b = 0; b < layout.bits / 8; ++b)
            out.push_back(static_cast<std::uint8_t>(sample >> 8 * b));
        }
        continue;
      }
      for (std::uint32_t s = 0; s < layout.samples; ++s) {
        std::uint32_t sample = sample_at(layout, x, y, s);
        const std::uint32_t most = layout.bits < 32 ? (1U << layout.bits) - 1 : UINT32_MAX;
        if (layout.photometric == 0) sample = most - sample;
        if (layout.bits < 8) sample = sample * 255 / most;
        for (std::uint32_t b = 0; b < std::max(1U, layout.bits / 8); ++b)
          out.push_back(static_cast<std::uint8_t>(sample >> 8 * b));
      }
    }
  }
  return out;
}

std::string text_of(const Layout& l) {
  return (l.tiled ? "tiles" : "strips") + std::string(l.planes ? " planes" : "") +
         (l.big_endian ? " MM" : " II") + " photometric " + std::to_string(l.photometric) + " " +
         std::to_string(l.samples) + " x " + std::to_string(l.bits) + (l.floats ? " float" : "") +
         " coding " + std::to_string(static_cast<int>(l.coding)) + " predictor " +
         std::to_string(l.predictor);
}

std::string refusal(const std::string& file) {
  try {
    test::read_all(in_memory(file, "a.tif"));
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    return e.what();
  }
  return "nothing";
}

}  // namespace

TEST_CASE("every kind of TIFF on the list is read as it was written", "[image][tiff]") {
  struct Kind {
    std::uint32_t photometric, samples, bits;
    bool floats;
    Values extra;
  };
  const std::vector<Kind> kinds{
      {1, 1, 1, false, {}},   {1, 1, 2, false, {}},  {1, 1, 4, false, {}},  {1, 1, 8, false, {}},
      {1, 1, 16, false, {}},  {1, 1, 16, true, {}},  {1, 1, 32, true, {}},  {1, 2, 8, false, {2}},
      {0, 1, 1, false, {}},   {0, 1, 4, false, {}},  {0, 1, 8, false, {}},  {2, 3, 8, false, {}},
      {0, 1, 16, false, {}},  {5, 4, 8, false, {}},  {5, 4, 16, false, {}}, {2, 3, 16, false, {}},
      {2, 3, 16, true, {}},   {2, 3, 32, true, {}},  {2, 4, 8, false, {2}}, {2, 4, 8, false, {}},
      {2, 4, 16, false, {2}}, {2, 4, 32, true, {0}}, {3, 1, 1, false, {}},  {3, 1, 2, false, {}},
      {3, 1, 4, false, {}},   {3, 1, 8, false, {}}};
  std::size_t read = 0;
  for (const Kind& kind : kinds) {
    for (const bool tiled : {false, true}) {
      for (const bool planes : {false, true}) {
        if (planes && kind.samples == 1) continue;
        for (const Coding coding :
             {Coding::none, Coding::lzw, Coding::deflate, Coding::pack_bits}) {
          for (std::uint32_t predictor = 1; predictor <= 3; ++predictor) {
            const bool predicts = coding == Coding::lzw || coding == Coding::deflate;
            if (predictor == 2 && (!predicts || kind.bits < 8)) continue;
            if (predictor == 3 && (!predicts || !kind.floats)) continue;
            for (const bool big_endian : {false, true}) {
              Layout layout{37,     21,    kind.photometric, kind.samples, kind.bits, kind.floats,
                            planes, tiled, big_endian,       coding,       predictor, kind.extra};
              CAPTURE(text_of(layout));
              std::vector<std::uint8_t> got;
              CHECK_NOTHROW(got = test::read_all(in_memory(tiff(layout)), 5));
              CHECK((got == expected(layout)));
              ++read;
            }
          }
        }
      }
    }
  }
  CHECK(read > 350);
}

TEST_CASE("a TIFF that does not say its bits is refused", "[image][tiff]") {
  // One bit by the standard, eight by the decoder, which then reads beyond the rows.
  Layout layout;
  layout.photometric = layout.samples = layout.bits = 1;
  CHECK(test::read_all(in_memory(tiff(layout))) == expected(layout));
  CHECK_THAT(refusal(tiff(layout, [](Entries& entries) { entries.erase(258); })),
             Contains("does not state its bits per sample (field 258)"));
}

TEST_CASE("a deflated strip that cannot be inflated is no picture", "[image][tiff]") {
  Layout layout;
  layout.coding = Coding::deflate;
  const std::string whole = tiff(layout);
  const std::vector<std::uint8_t> texels = expected(layout);
  // Within the first strip. Of a sample that is changed where it stands libtiff does not compare
  // the checksum; whatever cannot be inflated was taken for a picture, too.
  std::size_t wrong = 0, refused = 0;
  for (std::size_t at = 8; at < 600; at += 3) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x20);
    try {
      wrong += test::read_all(in_memory(damaged)) == texels ? 0 : 1;
    } catch (const Error&) {
      ++refused;
    }
  }
  CHECK(wrong <= 16);
  CHECK(refused == 198 - wrong);
}

TEST_CASE("a TIFF of colours that are not on the list is refused", "[image][tiff]") {
  for (const bool tiled : {false, true}) {
    Layout inks;  // not CMYK
    inks.photometric = 5;
    inks.samples = 4;
    inks.tiled = tiled;
    CHECK_THAT(refusal(tiff(inks,
                            [](Entries& e) {
                              e[332] = {3, {2}};
                            })),
               Contains("a.tif: TIFF images of ink colours") && Contains("convert it to RGB"));
    for (const auto& [photometric, name] :
         std::map<std::uint32_t, std::string>{{4, "mask"},
                                              {6, "YCbCr"},
                                              {8, "CIELAB"},
                                              {32844, "LogL"},
                                              {32845, "LogLuv"},
                                              {777, "type 777"}}) {
      Layout other;
      other.photometric = photometric;
      other.tiled = tiled;
      CHECK_THAT(refusal(tiff(other)), Contains(name + " colours"));
    }
  }
}

TEST_CASE("a TIFF of samples that are not on the list is refused", "[image][tiff]") {
  const auto of = [](std::uint32_t photometric, std::uint32_t samples, std::uint32_t bits) {
    Layout layout;
    layout.photometric = photometric;
    layout.samples = samples;
    layout.bits = bits;
    return layout;
  };
  CHECK_THAT(refusal(tiff(of(1, 1, 12))), Contains("12-bit"));
  CHECK_THAT(refusal(tiff(of(1, 1, 32))), Contains("32-bit unsigned"));
  CHECK_THAT(refusal(tiff(of(3, 1, 16))), Contains("palette colours with 1 samples of 16 bits"));
  CHECK_THAT(refusal(tiff(of(2, 2, 8))), Contains("RGB colours with 2 samples"));
  CHECK_THAT(refusal(tiff(of(0, 2, 8))), Contains("white-is-zero colours with 2 samples"));
  CHECK_THAT(refusal(tiff(of(2, 65, 8))), Contains("65 samples per texel"));
  for (const std::uint64_t format : {2ULL, 4ULL, 5ULL}) {
    CHECK_THAT(refusal(tiff(Layout{}, [&](Entries& e) { e[339].values = Values(3, format); })),
               Contains("convert it to 8-bit or 16-bit unsigned"));
  }
  CHECK_THAT(refusal(tiff(Layout{},
                          [](Entries& e) {
                            e[258].values = {8, 8, 16};
                          })),
             Contains("differ in bit depth"));
}

TEST_CASE("the old field for alpha may say that there is none", "[image][tiff]") {
  const auto with = [](std::uint64_t matteing) {
    return tiff(Layout{}, [&](Entries& e) { e[32995] = {3, {matteing}}; });
  };
  CHECK(test::read_all(in_memory(with(0), "a.tif")) == expected(Layout{}));
  CHECK_THAT(refusal(with(1)), Contains("32995 (Matteing) is invalid"));
}

TEST_CASE("a TIFF of a compression that is not on the list is refused", "[image][tiff]") {
  for (const auto& [coding, name] : std::map<std::uint64_t, std::string>{
           {3, "CCITT fax"}, {6, "old JPEG"}, {34887, "LERC"}, {9999, "type 9999"}}) {
    CHECK_THAT(refusal(tiff(Layout{}, [&](Entries& e) { e[259].values = {coding}; })),
               Contains("compression is " + name) && Contains("save it with ZIP"));
  }
}

TEST_CASE("a tiled TIFF without the bits of its samples is refused", "[image][tiff]") {
  Layout layout;
  layout.width = layout.height = 65;
  layout.tiled = true;
  CHECK_THAT(refusal(tiff(layout,
                          [](Entries& e) {
                            e.erase(258);
                            e[325].values.clear();
                          })),
             Contains("a.tif"));
  CHECK_THAT(refusal(tiff(layout, [](Entries& e) { e.erase(258); })),
             Contains("does not state its bits per sample"));
}

TEST_CASE("fields of a TIFF that contradict each other are refused", "[image][tiff]") {
  Layout tiled;
  tiled.tiled = true;
  const auto with = [&](const Layout& layout, int tag, const Values& values, int type = 4) {
    return refusal(tiff(layout, [&](Entries& e) { e[tag] = {type, values}; }));
  };
  const auto without = [&](const Layout& layout, int tag) {
    return refusal(tiff(layout, [&](Entries& e) { e.erase(tag); }));
  };
  CHECK_THAT(without({}, 262), Contains("its photometric interpretation (field 262)"));
  CHECK_THAT(without({}, 279), Contains("the offsets and sizes of its strips"));
  CHECK_THAT(without(tiled, 324), Contains("the offsets and sizes of its tiles"));
  CHECK_THAT(without(tiled, 323), Contains("its tile height (field 323)"));
  CHECK_THAT(with(tiled, 322, {24}, 3), Contains("tiles are 24 x 16"));
  CHECK_THAT(with(tiled, 322, {65536}), Contains("field 324") || Contains("tiles of 65536"));
  CHECK_THAT(with(tiled, 322, {16}, 2), Contains("field 322"));
  CHECK_THAT(with({}, 278, {0}, 3), Contains("have no rows"));
  CHECK_THAT(with({}, 278, {2}, 3), Contains("field 273"));
  CHECK_THAT(with({}, 273, {8, 900, 4000000000}), Contains("strip 3 of 3"));
  CHECK_THAT(with({}, 279, {888, 888, 1}), Contains("has 1 bytes"));
  // Rows of 111 bytes: 8, 8 and 5 of them. With another count libtiff read 7 of each strip.
  CHECK_THAT(with({}, 279, {889, 888, 555}),
             Contains("have 889 and 888 bytes for the same number of rows"));
  CHECK(with({}, 279, {888, 888, 556}) == "nothing");
  CHECK_THAT(with({}, 258, {8, 8}, 3), Contains("field 258"));
  CHECK_THAT(with({}, 338, {2}, 3), Contains("field 338"));
  CHECK_THAT(with({}, 284, {3}, 3), Contains("planar configuration 3"));
  CHECK_THAT(with({}, 256, {70000}), Contains("each side must be 1 to 65536"));
  Layout palette;
  palette.photometric = 3;
  palette.samples = 1;
  CHECK_THAT(with(palette, 320, Values(300, 5), 3), Contains("field 320"));
  CHECK_THAT(without(palette, 320), Contains("no palette"));
  // Twice: the first says 8 bits, the second something else.
  std::string twice = tiff(Layout{}, [](Entries& e) { e[260] = {3, {7}}; });
  const std::size_t at = twice.rfind(std::string("\x04\x01\x03\0", 4));
  REQUIRE(at != std::string::npos);
  twice[at] = '\x03';
  CHECK_THAT(refusal(twice), Contains("field 259 twice"));
}
