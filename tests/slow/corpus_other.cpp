// SPDX-License-Identifier: Apache-2.0
//
// Radiance HDR and PNM by hand, BMP and Targa by OpenImageIO.
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <fstream>

#include "corpus.h"
#include "unit/io/image_files.h"

namespace pounce::test::corpus {
namespace {

void save(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

struct Pnm {
  std::uint32_t width = 7, height = 5, channels = 3, largest = 255;
  const char* comment = "";
};

std::optional<Picture> write_pnm(const Pnm& pnm, const std::string& path, Random& random) {
  std::string file = fmt::format("P{}\n{}{} {}\n{}\n", pnm.channels == 3 ? 6 : 5, pnm.comment,
                                 pnm.width, pnm.height, pnm.largest);
  const bool wide = pnm.largest > 255;
  Picture out{pnm.width, pnm.height, pnm.channels, wide ? Depth::u16 : Depth::u8, false, {}};
  const std::size_t count = std::size_t{pnm.width} * pnm.height * pnm.channels;
  for (const std::uint32_t value : whole_values(random, count, pnm.largest)) {
    if (wide) file += static_cast<char>(value >> 8);
    file += static_cast<char>(value);
    const std::uint64_t full = wide ? 65535 : 255;
    const std::uint64_t scaled = (value * full + pnm.largest / 2) / pnm.largest;
    if (wide)
      append(out.samples, static_cast<std::uint16_t>(scaled));
    else
      append(out.samples, static_cast<std::uint8_t>(scaled));
  }
  save(path, file);
  return out;
}

void add_pnm(Entries& entries) {
  const auto one = [&](const std::string& name, const Pnm& pnm) {
    add(entries, "pnm-" + name + (pnm.channels == 3 ? ".ppm" : ".pgm"),
        [pnm](const std::string& path, Random& random) { return write_pnm(pnm, path, random); });
  };
  for (const std::uint32_t channels : {1U, 3U}) {
    for (const std::uint32_t largest : {1U, 15U, 100U, 255U, 256U, 1023U, 65535U})
      one(fmt::format("{}-{}", channels, largest), {7, 5, channels, largest});
    one(fmt::format("{}-1x1", channels), {1, 1, channels});
    one(fmt::format("{}-513x3", channels), {513, 3, channels});
    one(fmt::format("{}-comment", channels), {7, 5, channels, 255, "# 12 34\n#\n"});
  }
  for (const char* text : {"P1\n2 2\n1 0 0 1\n", "P2\n2 1\n255\n7 200\n", "P3\n1 1\n255\n1 2 3\n",
                           "P4\n8 2\n\x55\xAA"}) {
    add(entries, fmt::format("pnm-kind-{}.pnm", text[1]), [text](const std::string& path, Random&) {
      save(path, text);
      return std::optional<Picture>();
    });
  }
  add(entries, "pfm.pfm", [](const std::string& path, Random&) {
    save(path, std::string("PF\n1 1\n-1.0\n") + std::string(12, '\0'));
    return std::optional<Picture>();
  });
}

struct Hdr {
  std::uint32_t width = 40, height = 9;
  bool runs = true;
  const char* head = "FORMAT=32-bit_rle_rgbe\n";
  const char* start = "#?RADIANCE\n";
};

/// A scanline by runs, one component after the other.
std::string packed_row(const std::vector<std::uint8_t>& row) {
  const std::size_t width = row.size() / 4;
  std::string out{2, 2, static_cast<char>(width >> 8), static_cast<char>(width)};
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t x = 0; x < width;) {
      std::size_t run = 1;
      while (x + run < width && run < 127 && row[(x + run) * 4 + c] == row[x * 4 + c]) ++run;
      if (run > 2) {
        out += static_cast<char>(128 + run);
        out += static_cast<char>(row[x * 4 + c]);
      } else {
        run = 1;
        out += '\1';
        out += static_cast<char>(row[x * 4 + c]);
      }
      x += run;
    }
  }
  return out;
}

std::optional<Picture> write_hdr(const Hdr& hdr, const std::string& path, Random& random) {
  std::string file = fmt::format("{}{}\n-Y {} +X {}\n", hdr.start, hdr.head, hdr.height, hdr.width);
  Picture out{hdr.width, hdr.height, 3, Depth::float32, false, {}};
  for (std::uint32_t y = 0; y < hdr.height; ++y) {
    std::vector<std::uint8_t> row;
    for (std::uint32_t x = 0; x < hdr.width; ++x) {
      const int exponent = random.one_in(9) ? 0 : 120 + static_cast<int>(x / 6);
      for (int c = 0; c < 3; ++c) {
        // The largest is at least 128: else two could be taken for the mark of runs.
        const auto mantissa = static_cast<std::uint8_t>(c == 0             ? 128 + random.below(128)
                                                        : random.one_in(2) ? 77
                                                                           : random.below(256));
        row.push_back(mantissa);
        append(out.samples,
               exponent == 0 ? 0.0F : std::ldexp(static_cast<float>(mantissa), exponent - 136));
      }
      row.push_back(static_cast<std::uint8_t>(exponent));
    }
    file += hdr.runs ? packed_row(row) : std::string(row.begin(), row.end());
  }
  save(path, file);
  return out;
}

void add_hdr(Entries& entries) {
  const auto one = [&](const std::string& name, const Hdr& hdr) {
    add(entries, "hdr-" + name + ".hdr",
        [hdr](const std::string& path, Random& random) { return write_hdr(hdr, path, random); });
  };
  one("runs", {});
  one("flat", {40, 9, false});
  one("1x1", {1, 1, false});
  one("7x5", {7, 5, false});
  one("513x3", {513, 3, true});
  one("rgbe", {40, 9, true, "FORMAT=32-bit_rle_rgbe\n", "#?RGBE\n"});
  one("exposure", {40, 9, true, "FORMAT=32-bit_rle_rgbe\nEXPOSURE=2.0\nGAMMA=2.2\n# words\n"});
  for (const char* order : {"+Y 2 +X 1", "-Y 2 -X 1", "+X 1 -Y 2"}) {
    std::string name = order;
    name.erase(std::remove(name.begin(), name.end(), ' '), name.end());
    add(entries, "hdr-order" + name + ".hdr", [order](const std::string& path, Random&) {
      save(path, std::string("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n") + order + "\n" +
                     "\x90\x80\x70\x81\xA0\x10\x20\x80");
      return std::optional<Picture>();
    });
  }
}

struct Allowed {
  std::uint32_t channels = 3;
  const char* ending = "bmp";
  std::uint32_t width = 37, height = 29;
  bool runs = false;
};

std::optional<Picture> write_allowed(const Allowed& made, const std::string& path, Random& random) {
  Picture out{made.width, made.height, made.channels, Depth::u8, made.channels == 4, {}};
  for (const std::uint32_t value :
       whole_values(random, std::size_t{made.width} * made.height * made.channels, 255))
    append(out.samples, static_cast<std::uint8_t>(value));
  OIIO::ImageSpec spec(static_cast<int>(made.width), static_cast<int>(made.height),
                       static_cast<int>(made.channels), OIIO::TypeDesc::UINT8);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  if (made.runs) spec.attribute("compression", "rle");
  auto file = OIIO::ImageOutput::create(path);
  if (!file || !file->open(path, spec) ||
      !file->write_image(OIIO::TypeDesc::UINT8, out.samples.data()) || !file->close())
    throw std::runtime_error("OpenImageIO cannot write it");
  return out;
}

void add_allowed(Entries& entries) {
  struct Size {
    std::uint32_t width, height;
  };
  for (const char* ending : {"bmp", "tga"}) {
    for (const std::uint32_t channels : {1U, 3U, 4U}) {
      for (const Size& size : {Size{37, 29}, Size{1, 1}, Size{513, 3}}) {
        for (const bool runs : {false, true}) {
          if (runs && std::string(ending) == "bmp") continue;
          const Allowed made{channels, ending, size.width, size.height, runs};
          add(entries,
              fmt::format("{}-{}-{}x{}{}.{}", ending, channels, size.width, size.height,
                          runs ? "-runs" : "", ending),
              [made](const std::string& path, Random& random) {
                return write_allowed(made, path, random);
              });
        }
      }
    }
  }
}

/// A BMP with a palette: rows from below, padded to four bytes.
std::optional<Picture> write_bmp(std::uint32_t bits, const std::string& path, Random& random) {
  constexpr std::uint32_t kWidth = 37, kHeight = 5;
  const std::uint32_t colours = 1U << bits;
  std::vector<std::byte> head;
  for (const char c : {'B', 'M'}) append(head, c);
  const std::uint32_t row = (kWidth * bits + 31) / 32 * 4, start = 54 + colours * 4;
  for (const std::uint32_t n : {start + row * kHeight, 0U, start, 40U, kWidth, kHeight})
    append(head, n);
  append(head, std::uint16_t{1});
  append(head, static_cast<std::uint16_t>(bits));
  for (const std::uint32_t n : {0U, row * kHeight, 2835U, 2835U, colours, 0U}) append(head, n);
  std::vector<std::uint32_t> palette(colours);
  for (std::uint32_t& colour : palette) {
    colour = static_cast<std::uint32_t>(random.bits()) & 0xFFFFFFU;
    append(head, colour);
  }
  std::string file(reinterpret_cast<const char*>(head.data()), head.size());
  const std::vector<std::uint32_t> values =
      whole_values(random, std::size_t{kWidth} * kHeight, colours - 1);
  const std::vector<std::uint8_t> rows = packed(values, kWidth, bits);
  Picture out{kWidth, kHeight, 3, Depth::u8, false, {}};
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    const std::size_t size = rows.size() / kHeight;
    file.append(rows.begin() + static_cast<std::ptrdiff_t>((kHeight - 1 - y) * size),
                rows.begin() + static_cast<std::ptrdiff_t>((kHeight - y) * size));
    file.append(row - size, '\0');
  }
  for (const std::uint32_t value : values) {
    for (const int shift : {16, 8, 0})
      append(out.samples, static_cast<std::uint8_t>(palette[value] >> shift));
  }
  save(path, file);
  return out;
}

}  // namespace

Picture read_ppm(const std::string& path) {
  const std::string file = test::read_file(path);
  std::size_t at = 2;
  const auto number = [&] {
    while (at < file.size() && (file[at] == '#' || file[at] <= ' '))
      at = file[at] == '#' ? file.find('\n', at) : at + 1;
    std::uint32_t value = 0;
    for (; at < file.size() && file[at] >= '0' && file[at] <= '9'; ++at)
      value = value * 10 + static_cast<std::uint32_t>(file[at] - '0');
    return value;
  };
  const std::uint32_t width = number(), height = number(), largest = number();
  const std::size_t size = largest == 255 ? 1 : 2, count = std::size_t{width} * height * 3;
  if (!file.starts_with("P6") || (largest != 255 && largest != 65535) ||
      file.size() <= at + count * size)
    throw std::runtime_error(path + ": no such PPM, or truncated");
  Picture out{width, height, 3, size == 1 ? Depth::u8 : Depth::u16, false, {}};
  const auto* const from = reinterpret_cast<const unsigned char*>(file.data()) + at + 1;
  for (std::size_t i = 0; i < count; ++i) {
    if (size == 1)
      append(out.samples, from[i]);
    else
      append(out.samples, static_cast<std::uint16_t>(from[2 * i] << 8 | from[2 * i + 1]));
  }
  return out;
}

void add_other(Entries& entries) {
  add_pnm(entries);
  add_hdr(entries);
  add_allowed(entries);
  for (const std::uint32_t bits : {1U, 4U, 8U}) {
    add(entries, fmt::format("bmp-palette{}.bmp", bits),
        [bits](const std::string& path, Random& random) { return write_bmp(bits, path, random); });
  }
}

}  // namespace pounce::test::corpus
