// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>
// Wants FILE to be there.
#include <jpeglib.h>

#include <algorithm>
#include <array>

#include "corpus.h"

// What a JPEG decodes to is what libjpeg makes of it when asked for nothing special: the exact
// inverse transform, smooth upsampling. CMYK is multiplied out by hand.
namespace pounce::test::corpus {
namespace {

struct Jpeg {
  std::uint32_t width = 64, height = 48;
  J_COLOR_SPACE from = JCS_RGB, stored = JCS_YCbCr;
  int across = 1, down = 1;  ///< how much coarser chroma is
  enum class Scans { one, each, progressive } scans = Scans::one;
  bool arithmetic = false, optimised = false;
  unsigned restart = 0;  ///< units between marks
  int quality = 90;
  bool adobe = true, jfif = true;
  int marker = 0;  ///< an APPn of that n with a profile or other data
};

int samples_of(J_COLOR_SPACE space) {
  return space == JCS_GRAYSCALE ? 1 : space == JCS_CMYK || space == JCS_YCCK ? 4 : 3;
}

/// Whole pictures, so that coefficients of all frequencies are there.
std::vector<std::uint8_t> picture(const Jpeg& jpeg, Random& random) {
  const int samples = samples_of(jpeg.from);
  std::vector<std::uint8_t> out;
  for (std::uint32_t y = 0; y < jpeg.height; ++y) {
    for (std::uint32_t x = 0; x < jpeg.width; ++x) {
      for (int c = 0; c < samples; ++c) {
        const double slope = 255.0 * (c % 2 == 0 ? x : y) / (c % 2 == 0 ? jpeg.width : jpeg.height);
        const double edge = (x / 11 + y / 7 + static_cast<unsigned>(c)) % 2 == 0 ? 40 : -40;
        out.push_back(static_cast<std::uint8_t>(
            std::clamp(slope + edge + random.between(-20.0, 20.0), 0.0, 255.0)));
      }
    }
  }
  return out;
}

void describe(jpeg_compress_struct& c, const Jpeg& jpeg, std::vector<jpeg_scan_info>& scans) {
  c.image_width = jpeg.width;
  c.image_height = jpeg.height;
  c.input_components = samples_of(jpeg.from);
  c.in_color_space = jpeg.from;
  jpeg_set_defaults(&c);
  jpeg_set_colorspace(&c, jpeg.stored);
  jpeg_set_quality(&c, jpeg.quality, TRUE);
  const bool chroma = jpeg.stored == JCS_YCbCr || jpeg.stored == JCS_YCCK;
  for (int i = 0; i < c.num_components; ++i) {
    const bool fine = !chroma || i == 0 || i == 3;
    c.comp_info[i].h_samp_factor = fine ? jpeg.across : 1;
    c.comp_info[i].v_samp_factor = fine ? jpeg.down : 1;
  }
  c.write_Adobe_marker = c.write_Adobe_marker != 0 && jpeg.adobe ? TRUE : FALSE;
  c.write_JFIF_header = c.write_JFIF_header != 0 && jpeg.jfif ? TRUE : FALSE;
  c.arith_code = jpeg.arithmetic ? TRUE : FALSE;
  c.optimize_coding = jpeg.optimised ? TRUE : FALSE;
  c.restart_interval = jpeg.restart;
  if (jpeg.scans == Jpeg::Scans::progressive) jpeg_simple_progression(&c);
  if (jpeg.scans == Jpeg::Scans::each) {
    for (int i = 0; i < c.num_components; ++i)
      scans.push_back({1, {i, 0, 0, 0}, 0, DCTSIZE2 - 1, 0, 0});
    c.scan_info = scans.data();
    c.num_scans = static_cast<int>(scans.size());
  }
}

void write_marker(jpeg_compress_struct& c, int marker) {
  if (marker == 2) {
    const std::vector<std::byte> profile = display_p3_profile();
    jpeg_write_icc_profile(&c, reinterpret_cast<const JOCTET*>(profile.data()),
                           static_cast<unsigned>(profile.size()));
  } else if (marker == 1) {
    // Exif of one field: the orientation is 6.
    constexpr std::array<JOCTET, 32> kExif{'E', 'x', 'i', 'f',  0, 0, 'I', 'I', '*', 0, 8, 0, 0,
                                           0,   1,   0,   0x12, 1, 3, 0,   1,   0,   0, 0, 6};
    jpeg_write_marker(&c, JPEG_APP0 + 1, kExif.data(), kExif.size());
  } else if (marker > 0) {
    const std::vector<JOCTET> data(3000, 0xFF);
    jpeg_write_marker(&c, JPEG_APP0 + marker, data.data(), static_cast<unsigned>(data.size()));
    jpeg_write_marker(&c, JPEG_COM, data.data(), 5);
  }
}

void encode(const Jpeg& jpeg, const std::string& path, Random& random) {
  std::vector<std::uint8_t> samples = picture(jpeg, random);
  jpeg_compress_struct c{};
  jpeg_error_mgr errors{};
  std::vector<jpeg_scan_info> scans;
  c.err = jpeg_std_error(&errors);
  jpeg_create_compress(&c);
  FILE* const file = std::fopen(path.c_str(), "wb");
  jpeg_stdio_dest(&c, file);
  describe(c, jpeg, scans);
  jpeg_start_compress(&c, TRUE);
  write_marker(c, jpeg.marker);
  const std::size_t row = std::size_t{jpeg.width} * static_cast<std::size_t>(samples_of(jpeg.from));
  for (std::uint32_t y = 0; y < jpeg.height; ++y) {
    JSAMPROW rows = samples.data() + y * row;
    jpeg_write_scanlines(&c, &rows, 1);
  }
  jpeg_finish_compress(&c);
  jpeg_destroy_compress(&c);
  std::fclose(file);
}

Picture decode(const std::string& path) {
  jpeg_decompress_struct d{};
  jpeg_error_mgr errors{};
  d.err = jpeg_std_error(&errors);
  jpeg_create_decompress(&d);
  FILE* const file = std::fopen(path.c_str(), "rb");
  jpeg_stdio_src(&d, file);
  jpeg_read_header(&d, TRUE);
  const bool inks = d.num_components == 4;
  d.out_color_space = inks ? JCS_CMYK : d.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_start_decompress(&d);
  Picture out{d.output_width, d.output_height, d.num_components == 1 ? 1U : 3U,
              Depth::u8,      false,           {}};
  std::vector<std::uint8_t> row(std::size_t{d.output_width} *
                                static_cast<std::size_t>(d.output_components));
  while (d.output_scanline < d.output_height) {
    JSAMPROW rows = row.data();
    jpeg_read_scanlines(&d, &rows, 1);
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (inks && i % 4 == 3) continue;
      // Adobe stores inks as what is left of the light: 255 for no ink.
      const unsigned value = inks ? (row[i] * row[i / 4 * 4 + 3] + 127U) / 255U : row[i];
      append(out.samples, static_cast<std::uint8_t>(value));
    }
  }
  jpeg_finish_decompress(&d);
  jpeg_destroy_decompress(&d);
  std::fclose(file);
  return out;
}

void add(Entries& entries, const std::string& name, const Jpeg& jpeg) {
  corpus::add(entries, "jpeg-" + name + ".jpg", [jpeg](const std::string& path, Random& random) {
    encode(jpeg, path, random);
    return std::optional(decode(path));
  });
}

struct Kind {
  const char* name;
  J_COLOR_SPACE from, stored;
  int across = 1, down = 1;
};

constexpr std::array<Kind, 13> kKinds{{{"grey", JCS_GRAYSCALE, JCS_GRAYSCALE},
                                       {"444", JCS_RGB, JCS_YCbCr},
                                       {"422", JCS_RGB, JCS_YCbCr, 2, 1},
                                       {"420", JCS_RGB, JCS_YCbCr, 2, 2},
                                       {"411", JCS_RGB, JCS_YCbCr, 4, 1},
                                       {"440", JCS_RGB, JCS_YCbCr, 1, 2},
                                       {"410", JCS_RGB, JCS_YCbCr, 4, 2},
                                       {"441", JCS_RGB, JCS_YCbCr, 1, 4},
                                       {"311", JCS_RGB, JCS_YCbCr, 3, 1},
                                       {"rgb", JCS_RGB, JCS_RGB},
                                       {"cmyk", JCS_CMYK, JCS_CMYK},
                                       {"ycck", JCS_CMYK, JCS_YCCK},
                                       {"ycck-420", JCS_CMYK, JCS_YCCK, 2, 2}}};

void add_kinds(Entries& entries) {
  struct Size {
    std::uint32_t width, height;
  };
  for (const Kind& kind : kKinds) {
    Jpeg jpeg;
    jpeg.from = kind.from;
    jpeg.stored = kind.stored;
    jpeg.across = kind.across;
    jpeg.down = kind.down;
    for (const Size& size : {Size{64, 48}, Size{1, 1}, Size{37, 131}}) {
      jpeg.width = size.width;
      jpeg.height = size.height;
      const std::string name = fmt::format("{}-{}x{}", kind.name, size.width, size.height);
      for (const auto scans : {Jpeg::Scans::one, Jpeg::Scans::each, Jpeg::Scans::progressive}) {
        jpeg.scans = scans;
        const char* const how = scans == Jpeg::Scans::one    ? ""
                                : scans == Jpeg::Scans::each ? "-scans"
                                                             : "-progressive";
        add(entries, name + how, jpeg);
      }
      jpeg.scans = Jpeg::Scans::one;
    }
    for (const auto scans : {Jpeg::Scans::one, Jpeg::Scans::progressive}) {
      jpeg.scans = scans;
      jpeg.arithmetic = true;
      add(entries,
          fmt::format("{}-arithmetic{}", kind.name,
                      scans == Jpeg::Scans::one ? "" : "-progressive"),
          jpeg);
    }
  }
}

}  // namespace

void add_jpeg(Entries& entries) {
  add_kinds(entries);
  Jpeg jpeg;
  jpeg.across = jpeg.down = 2;
  for (const unsigned restart : {1U, 7U}) {
    jpeg.restart = restart;
    add(entries, fmt::format("restart-{}", restart), jpeg);
    jpeg.arithmetic = true;
    add(entries, fmt::format("restart-{}-arithmetic", restart), jpeg);
    jpeg.arithmetic = false;
  }
  jpeg.restart = 0;
  jpeg.width = 501;
  jpeg.height = 403;
  add(entries, "large", jpeg);
  jpeg.scans = Jpeg::Scans::progressive;
  add(entries, "large-progressive", jpeg);
  jpeg.scans = Jpeg::Scans::one;
  jpeg.width = 64;
  jpeg.height = 48;
  for (const int quality : {1, 30, 100}) {
    jpeg.quality = quality;
    add(entries, fmt::format("quality-{}", quality), jpeg);
  }
  jpeg.quality = 90;
  jpeg.optimised = true;
  add(entries, "optimised", jpeg);
  jpeg.optimised = false;
  for (const int marker : {1, 2, 3, 13}) {
    jpeg.marker = marker;
    add(entries, fmt::format("app{}", marker), jpeg);
  }
  jpeg.marker = 0;
  jpeg.jfif = jpeg.adobe = false;
  add(entries, "no-jfif", jpeg);
  jpeg.across = jpeg.down = 1;
  jpeg.stored = JCS_RGB;  // told by the components' letters
  add(entries, "rgb-no-adobe", jpeg);
  jpeg.from = jpeg.stored = JCS_CMYK;
  add(entries, "cmyk-no-adobe", jpeg);
}

}  // namespace pounce::test::corpus
