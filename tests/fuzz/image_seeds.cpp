// SPDX-License-Identifier: Apache-2.0
//
// A small image of every kind that is read and of the kinds next to them.
#include "fuzz/image_seeds.h"

#include <OpenImageIO/imageio.h>

#include <array>
#include <filesystem>
#include <map>
#include <random>
#include <vector>

#include "unit/io/image_files.h"

namespace pounce::fuzz {
namespace {

namespace fs = std::filesystem;
using OIIO::TypeDesc;
using test::write_file;

/// How an image is written; attributes are OpenImageIO's.
struct Kind {
  int width = 33, height = 70, channels = 3;
  TypeDesc type = TypeDesc::UINT8;
  int tile = 0, levels = 1;
  std::map<std::string, std::string> texts{};
  std::map<std::string, int> numbers{};
  std::vector<std::string> names{};
};

OIIO::ImageSpec spec_of(const Kind& kind, int level = 0) {
  OIIO::ImageSpec spec(std::max(1, kind.width >> level), std::max(1, kind.height >> level),
                       kind.channels, kind.type);
  spec.tile_width = spec.tile_height = kind.tile;
  for (const auto& [name, value] : kind.texts) spec.attribute(name, value);
  for (const auto& [name, value] : kind.numbers) spec.attribute(name, value);
  if (!kind.names.empty()) spec.channelnames = kind.names;
  if (kind.levels > 1) spec.attribute("textureformat", "Plain Texture");
  return spec;
}

/// Slopes with a little noise.
std::vector<float> texels_of(const OIIO::ImageSpec& spec) {
  std::vector<float> texels(spec.image_pixels() * static_cast<std::size_t>(spec.nchannels));
  for (std::size_t i = 0; i < texels.size(); ++i)
    texels[i] = static_cast<float>(i % 997) / 1000 + static_cast<float>(i * 7 % 5) / 2000;
  return texels;
}

/// One part for each kind. What this OpenImageIO does not write is left out.
void write(const fs::path& path, const std::vector<Kind>& parts) {
  auto out = OIIO::ImageOutput::create(path.string());
  std::vector<OIIO::ImageSpec> specs;
  for (const Kind& kind : parts) specs.push_back(spec_of(kind));
  const bool opened =
      out &&
      (specs.size() > 1 ? out->open(path.string(), static_cast<int>(specs.size()), specs.data())
                        : out->open(path.string(), specs.front()));
  for (std::size_t part = 0; opened && part < parts.size(); ++part) {
    if (part > 0) out->open(path.string(), specs[part], OIIO::ImageOutput::AppendSubimage);
    for (int level = 0; level < parts[part].levels; ++level) {
      const OIIO::ImageSpec spec = spec_of(parts[part], level);
      if (level > 0 && !out->open(path.string(), spec, OIIO::ImageOutput::AppendMIPLevel)) break;
      out->write_image(TypeDesc::FLOAT, texels_of(spec).data());
    }
  }
  if (out) out->close();
}

void tiff_seeds(const fs::path& folder) {
  int number = 0;
  const auto add = [&](const Kind& kind) {
    write(folder / ("t" + std::to_string(++number) + ".tif"), {kind});
  };
  for (const char* coding : {"none", "lzw", "zip", "packbits"}) {
    for (const TypeDesc& type : {TypeDesc(TypeDesc::UINT8), TypeDesc(TypeDesc::UINT16),
                                 TypeDesc(TypeDesc::FLOAT), TypeDesc(TypeDesc::HALF)}) {
      Kind kind{.type = type};
      kind.texts["compression"] = coding;
      kind.numbers["tiff:half"] = 1;
      add(kind);
      kind.tile = 16;
      kind.texts["planarconfig"] = "separate";
      add(kind);
    }
  }
  for (const int bits : {1, 2, 4}) {
    Kind kind{.channels = 1};
    kind.numbers["oiio:BitsPerSample"] = bits;
    add(kind);
    kind.texts["compression"] = "none";
    add(kind);
  }
  Kind kind{.channels = 4};
  kind.numbers["tiff:bigtiff"] = 1;
  add(kind);
  kind.texts["planarconfig"] = "separate";
  kind.texts["compression"] = "none";
  kind.numbers["oiio:UnassociatedAlpha"] = 1;
  add(kind);
  kind.tile = 32;
  add(kind);
  kind.texts["compression"] = "zip";
  kind.numbers["tiff:RowsPerStrip"] = 70;
  kind.tile = 0, kind.channels = 1;
  add(kind);
  kind.numbers["tiff:zipquality"] = 9;
  kind.levels = 4, kind.tile = 16, kind.channels = 3;
  add(kind);
}

/// Four colours, two bits for each texel, in one strip.
std::string palette_tiff() {
  std::string file("II*\0\x08\0\0\0", 8), values;
  const auto number = [](std::uint32_t n, int bytes) {
    std::string out;
    for (; bytes-- > 0; n >>= 8) out += static_cast<char>(n);
    return out;
  };
  constexpr std::uint32_t kFields = 9, kValues = 8 + 2 + 12 * kFields + 4;
  const auto field = [&](std::uint32_t tag, std::uint32_t type, std::uint32_t count,
                         std::uint32_t n) {
    file += number(tag, 2) + number(type, 2) + number(count, 4) + number(n, 4);
  };
  file += number(kFields, 2);
  field(256, 3, 1, 10), field(257, 3, 1, 6), field(258, 3, 1, 2), field(259, 3, 1, 1);
  field(262, 3, 1, 3), field(273, 4, 1, kValues + 24), field(278, 3, 1, 6);
  field(279, 4, 1, 18), field(320, 3, 12, kValues);
  return file + std::string(4, '\0') + std::string("0123456789abcdefghijklmn") +
         std::string(18, '\x1B');
}

void exr_seeds(const fs::path& folder) {
  for (const char* coding :
       {"none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"}) {
    Kind kind{.channels = 4, .type = TypeDesc::HALF};
    kind.texts["compression"] = coding;
    write(folder / (std::string(coding) + ".exr"), {kind});
    kind.tile = 16, kind.levels = 3;
    kind.type = TypeDesc::FLOAT;
    write(folder / (std::string(coding) + "-tiles.exr"), {kind});
  }
  Kind left{.type = TypeDesc::HALF}, right = left, depth{.channels = 1, .type = TypeDesc::FLOAT};
  left.texts["oiio:subimagename"] = "left", right.texts["oiio:subimagename"] = "right";
  depth.texts["oiio:subimagename"] = "depth";
  depth.names = {"Z"};
  write(folder / "parts.exr", {left, right, depth});
  left.tile = depth.tile = 32;  // OpenImageIO 2.4 dies where one part has tiles and another none
  write(folder / "tiled-parts.exr", {left, depth});
  Kind layers{.channels = 6, .type = TypeDesc::HALF};
  layers.names = {"R", "G", "B", "normal.X", "normal.Y", "normal.Z"};
  write(folder / "layers.exr", {layers});
}

/// The bits of a scan are noise that every code fits: they decode to something.
class Jpeg {
 public:
  explicit Jpeg(std::uint8_t frame) : frame_(frame) {}

  /// Sampling factors of each component: 0x11, 0x22.
  std::string made(const std::vector<std::uint8_t>& factors, bool adobe, int restart,
                   const std::vector<std::array<std::uint8_t, 4>>& scans) {
    using namespace std::string_literals;
    std::string out = "\xFF\xD8"s;
    if (adobe) out += segment(0xEE, "Adobe\0\x64\0\0\0\0\2"s);
    out += segment(0xDB, "\0"s + std::string(64, '\3'));
    const auto count = static_cast<char>(factors.size());
    std::string frame = "\x08\0\x17\0\x21"s + count;  // 33 x 23
    for (std::size_t i = 0; i < factors.size(); ++i)
      frame += {static_cast<char>(i + 1), static_cast<char>(factors[i]), 0};
    out += segment(frame_, frame);
    for (const char table : {'\0', '\x10'}) {
      // One code of one bit, one of two, two of three.
      out += segment(0xC4, table + "\1\1\2\0\0\0\0\0\0\0\0\0\0\0\0\0"s +
                               (table == 0 ? "\0\2\1\3"s : "\0\1\x11\xF0"s));
    }
    if (restart > 0) out += segment(0xDD, {'\0', static_cast<char>(restart)});
    for (const auto& [first, last, high_low, all] : scans) {
      for (std::size_t i = 0; i < (all != 0 ? 1 : factors.size()); ++i) {
        std::string header(1, all != 0 ? count : '\1');
        for (std::size_t c = all != 0 ? 0 : i; c < (all != 0 ? factors.size() : i + 1); ++c)
          header += {static_cast<char>(c + 1), 0};
        header += {static_cast<char>(first), static_cast<char>(last), static_cast<char>(high_low)};
        out += segment(0xDA, header) + bits(300);
      }
    }
    return out + "\xFF\xD9"s;
  }

 private:
  static std::string segment(int marker, const std::string& data) {
    const std::size_t size = data.size() + 2;
    return std::string{'\xFF', static_cast<char>(marker), static_cast<char>(size >> 8),
                       static_cast<char>(size)} +
           data;
  }
  std::string bits(int count) {
    std::string out;
    for (int i = 0; i < count; ++i) out += static_cast<char>(random_() & random_() & 0x7E);
    return out;
  }

  std::uint8_t frame_;
  std::minstd_rand random_{7};
};

void jpeg_seeds(const fs::path& folder) {
  for (const int progressive : {0, 1}) {
    for (const char* sampling : {"4:4:4", "4:2:0", "4:2:2", "4:1:1"}) {
      Kind kind;
      kind.texts["jpeg:subsampling"] = sampling;
      kind.numbers["jpeg:progressive"] = progressive;
      write(folder /
                (std::string(1, sampling[2]) + sampling[4] + std::to_string(progressive) + ".jpg"),
            {kind});
    }
    Kind grey{.channels = 1};
    grey.numbers["jpeg:progressive"] = progressive;
    write(folder / ("grey" + std::to_string(progressive) + ".jpg"), {grey});
  }
  int number = 0;
  const auto put = [&](const std::string& bytes) {
    write_file((folder / ("made" + std::to_string(++number) + ".jpg")).string(), bytes);
  };
  using Scans = std::vector<std::array<std::uint8_t, 4>>;
  const Scans whole{{0, 63, 0, 1}}, apart{{0, 63, 0, 0}};
  const Scans refined{{0, 0, 1, 1},     {1, 5, 2, 0},    {6, 63, 2, 0},
                      {1, 63, 0x21, 0}, {0, 0, 0x10, 1}, {1, 63, 0x10, 0}};
  for (const std::vector<std::uint8_t>& factors : {std::vector<std::uint8_t>{0x11},
                                                   {0x22, 0x11, 0x11},
                                                   {0x11, 0x11, 0x11, 0x11},
                                                   {0x22, 0x11, 0x11, 0x22},
                                                   {0x41, 0x12, 0x21}}) {
    for (const bool adobe : {false, true}) {
      put(Jpeg(0xC0).made(factors, adobe, 0, whole));
      put(Jpeg(0xC1).made(factors, adobe, 3, apart));
      put(Jpeg(0xC2).made(factors, adobe, 0, refined));
    }
  }
  put(Jpeg(0xC9).made({0x22, 0x11, 0x11}, false, 0, whole));
  put(Jpeg(0xCA).made({0x11}, false, 2, refined));
}

void png_seeds(const fs::path& folder) {
  for (const TypeDesc& type : {TypeDesc(TypeDesc::UINT8), TypeDesc(TypeDesc::UINT16)}) {
    for (int channels = 1; channels <= 4; ++channels) {
      write(folder / ((type.size() == 1 ? "8-" : "16-") + std::to_string(channels) + ".png"),
            {{.channels = channels, .type = type}});
    }
  }
  int number = 0;
  for (const auto& [colour, bits] : std::vector<std::pair<int, int>>{{0, 1},
                                                                     {0, 2},
                                                                     {0, 4},
                                                                     {0, 8},
                                                                     {0, 16},
                                                                     {2, 8},
                                                                     {2, 16},
                                                                     {3, 1},
                                                                     {3, 4},
                                                                     {3, 8},
                                                                     {4, 8},
                                                                     {6, 16}}) {
    constexpr std::array<int, 7> kSamples{1, 0, 3, 1, 2, 0, 4};
    for (const bool interlaced : {false, true}) {
      // 9 x 5: of the passes of Adam7 the columns and rows.
      const std::vector<std::pair<int, int>> passes =
          interlaced ? std::vector<std::pair<int, int>>{{2, 1}, {1, 1}, {3, 1}, {2, 2},
                                                        {5, 1}, {4, 3}, {9, 2}}
                     : std::vector<std::pair<int, int>>{{9, 5}};
      std::string rows;
      for (const auto& [across, down] : passes) {
        const int bytes = (across * bits * kSamples[static_cast<std::size_t>(colour)] + 7) / 8;
        for (int y = 0; y < down; ++y)
          rows += static_cast<char>(y % 5) + std::string(static_cast<std::size_t>(bytes), '\x12');
      }
      const std::string palette = colour == 3 ? std::string(3U << std::min(bits, 5), '\x77') : "";
      const std::string clear = colour == 3   ? "\x10\x20"
                                : colour == 0 ? std::string("\0\2", 2)
                                : colour == 2 ? std::string("\0\1\0\2\0\3", 6)
                                              : "";
      write_file((folder / ("made" + std::to_string(++number) + ".png")).string(),
                 test::make_png(9, 5, bits, colour, interlaced, rows, palette, clear));
    }
  }
}

}  // namespace

void put_images(const fs::path& folder) {
  fs::create_directories(folder);
  png_seeds(folder);
  jpeg_seeds(folder);
  tiff_seeds(folder);
  write_file((folder / "palette.tif").string(), palette_tiff());
  exr_seeds(folder);
  for (const int channels : {3, 4}) {
    for (const char* coding : {"webp:30", "lossless"}) {
      Kind kind{.channels = channels};
      kind.texts["compression"] = coding;
      write(folder / (std::string(coding, 4) + std::to_string(channels) + ".webp"), {kind});
    }
  }
}

}  // namespace pounce::fuzz
