// SPDX-License-Identifier: Apache-2.0
#include <zlib.h>

#include <catch2/catch.hpp>
#include <chrono>

#include "io/codec/guard.h"
#include "io/image/write.h"
#include "pounce/error.h"
#include "support/resident_memory.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Contains;
using test::in_memory;

namespace {

constexpr std::size_t kMuch = 48 << 20;
const std::vector<ImageFormat> kAllowed{ImageFormat::bmp, ImageFormat::tga};

/// A WebP's picture of 16 x 16 texels.
const std::string kWebpChunk(
    "\x56\x50\x38\x20\x36\x00\x00\x00\x50\x02\x00\x9D\x01\x2A\x10\x00\x10\x00\x00\x00"
    "\x00\x25\xA0\x02\x74\xBA\x01\xF8\x01\xFA\x01\xFC\x00\x07\x90\x00\xFE\xED\xCE\xDF"
    "\xFF\x92\x0F\x5E\x4F\x3F\x3F\xF2\x42\x3F\xFE\xD4\x9F\xAF\x30\x72\xBF\xFB\x4C\x80"
    "\x00\x00",
    62);

std::string big_endian(std::uint32_t n, int size) {
  std::string out;
  for (int i = size - 1; i >= 0; --i) out += static_cast<char>(n >> 8 * i);
  return out;
}

std::string little_endian(std::uint64_t n, int size) {
  std::string out;
  for (int i = 0; i < size; ++i) out += static_cast<char>(n >> 8 * i);
  return out;
}

/// A file of 16 x 16 texels.
std::string image_file(const std::string& ending, Depth depth = Depth::u8) {
  test::TempFolder folder;
  const std::string path = folder.file("a" + ending);
  const io::ImageWriteSpec spec{16, 16, 3, depth, depth >= Depth::half, false};
  io::ImageWriter writer(path, spec);
  std::vector<std::byte> rows(16 * 16 * 3 * 4);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<std::byte>(i % 60);
  writer.write_rows(16, rows.data());
  writer.commit();
  return test::read_file(path);
}

/// A chunk whose checksum nobody looks at.
std::string png_chunk(const std::string& type, const std::string& data) {
  return big_endian(static_cast<std::uint32_t>(data.size()), 4) + type + data + "nono";
}

std::string with_png_chunk(const std::string& png, const std::string& chunk) {
  return png.substr(0, 33) + chunk + png.substr(33);
}

std::string jpeg_segment(char marker, const std::string& data) {
  return std::string{'\xFF', marker} + big_endian(static_cast<std::uint32_t>(data.size()) + 2, 2) +
         data;
}

/// The TIFF with one more field in its directory, whose values are at its end.
std::string with_tiff_field(const std::string& tiff, std::uint16_t tag, std::uint16_t type,
                            std::uint32_t count, const std::string& values) {
  const auto number = [&](std::size_t at, int size) {
    std::uint32_t n = 0;
    for (int i = size - 1; i >= 0; --i)
      n = n << 8 | static_cast<std::uint8_t>(tiff[at + static_cast<std::size_t>(i)]);
    return n;
  };
  const std::size_t place = number(4, 4);
  const std::uint32_t fields = number(place, 2);
  const std::string field = little_endian(tag, 2) + little_endian(type, 2) +
                            little_endian(count, 4) + little_endian(tiff.size(), 4);
  std::string all;
  bool added = false;
  for (std::size_t i = 0; i < fields; ++i) {
    const std::string old = tiff.substr(place + 2 + 12 * i, 12);
    if (!added && number(place + 2 + 12 * i, 2) > tag) {
      all += field;
      added = true;
    }
    all += old;
  }
  if (!added) all += field;
  std::string out = tiff + values;
  const std::size_t end = out.size();
  out += little_endian(fields + 1, 2) + all + std::string(4, '\0');
  return out.replace(4, 4, little_endian(end, 4));
}

std::string with_exr_attribute(const std::string& exr, std::uint32_t claimed,
                               const std::string& value) {
  return exr.substr(0, 8) + "manifest" + '\0' + "string" + '\0' + little_endian(claimed, 4) +
         value + exr.substr(8);
}

/// A BMP with run lengths: every texel of a row has the row's number.
std::string run_length_bmp(std::uint32_t width, std::uint32_t height, int bits,
                           const std::string& palette) {
  std::string runs;
  for (std::uint32_t y = 0; y < height; ++y) {
    if (y > 0) runs += std::string(2, '\0');
    for (std::uint32_t x = 0; x < width; x += 250) {
      runs += static_cast<char>(std::min(250U, width - x));
      runs += static_cast<char>(y);
    }
  }
  runs += std::string("\0\1", 2);
  const std::uint64_t start = 54 + palette.size();
  return "BM" + little_endian(start + runs.size(), 4) + little_endian(0, 4) +
         little_endian(start, 4) + little_endian(40, 4) + little_endian(width, 4) +
         little_endian(height, 4) + little_endian(1, 2) +
         little_endian(static_cast<std::uint64_t>(bits), 2) + little_endian(1, 4) +
         little_endian(runs.size(), 4) + little_endian(0, 8) +
         little_endian(palette.size() / 4, 4) + little_endian(0, 4) + palette + runs;
}

/// 256 colours; all grey ones, or not.
std::string bmp_palette(bool grey) {
  std::string out;
  for (int i = 0; i < 256; ++i) {
    const char value = static_cast<char>(i);
    out += {value, grey ? value : '\x05', value, '\0'};
  }
  return out;
}

/// Reads the file and says what that took.
struct Reading {
  std::vector<std::uint8_t> samples;
  std::uint64_t memory = 0;
  double seconds = 0;
};
Reading reading(const std::string& file) {
  const mesh::ImageRef image = in_memory(file);
  const std::uint64_t before = test::reset_peak_rss();
  const auto start = std::chrono::steady_clock::now();
  Reading out;
  out.samples = test::read_all(image, 1000000, kAllowed);
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  out.memory = test::peak_rss() - std::min(before, test::peak_rss());
  return out;
}

void check_small(const std::string& file, const std::vector<std::uint8_t>& samples) {
  const Reading got = reading(file);
  CHECK(got.samples == samples);
  CHECK(got.memory < kMuch / 3);
  CHECK(got.seconds < 2);
}

std::string refusal(const std::string& file) {
  const mesh::ImageRef image = in_memory(file);
  const std::uint64_t before = test::reset_peak_rss();
  try {
    test::read_all(image, 1000000, kAllowed);
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    CHECK(test::peak_rss() - std::min(before, test::peak_rss()) < kMuch / 3);
    return e.what();
  }
  return "nothing";
}

}  // namespace

TEST_CASE("texts, profiles and EXIF of a PNG are never decoded", "[image]") {
  const std::string png = image_file(".png");
  const auto samples = reading(png).samples;
  for (const char* type : {"tEXt", "zTXt", "iTXt", "iCCP", "eXIf", "sPLT", "abCd"})
    check_small(with_png_chunk(png, png_chunk(type, std::string(kMuch, 'x'))), samples);
  std::string many;
  for (int i = 0; i < 200000; ++i) many += png_chunk("zTXt", "k");
  check_small(with_png_chunk(png, many), samples);
  check_small(png + std::string(kMuch, 'x'), samples);  // behind its end
}

TEST_CASE("a PNG chunk that claims more than there is, or that must be known, is refused",
          "[image]") {
  const std::string png = image_file(".png");
  const std::string claim = big_endian(1'150'000'000, 4) + "tEXtk";
  CHECK_THAT(refusal(png.substr(0, 33) + claim + std::string(12, 'x')),
             Contains("the file ends too early"));
  const std::string unknown = "ABCDx";
  const auto crc = static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(unknown.data()), static_cast<uInt>(unknown.size())));
  CHECK_THAT(refusal(with_png_chunk(png, big_endian(1, 4) + unknown + big_endian(crc, 4))),
             Contains("ABCD") && Contains("critical chunk"));
}

TEST_CASE("what a PNG's chunks hold counts, and what they are checked by", "[image]") {
  // Its last chunk of samples ends with the sum over what is inflated, then with its CRC.
  const std::string png = image_file(".png");
  const auto samples = reading(png).samples;
  const std::size_t end = png.rfind("IEND") - 4, begin = png.rfind("IDAT", end);
  const auto with_byte = [&](std::size_t at, bool seal) {
    std::string changed = png;
    changed[at] = static_cast<char>(changed[at] ^ 0x5A);
    const auto* const chunk = reinterpret_cast<const Bytef*>(changed.data() + begin);
    const auto crc =
        static_cast<std::uint32_t>(crc32(0, chunk, static_cast<uInt>(end - 4 - begin)));
    return seal ? changed.replace(end - 4, 4, big_endian(crc, 4)) : changed;
  };
  // That sum alone is wrong: of the file's bytes nothing is, and the samples are what they say.
  CHECK(reading(with_byte(end - 6, true)).samples == samples);
  CHECK_THAT(refusal(with_byte(end - 6, false)), Contains("the checksum of its IDAT chunk"));
  CHECK_THAT(refusal(with_byte((begin + end) / 2, false)), Contains("damaged"));
}

TEST_CASE("a PNG's transparency and palette still count", "[image]") {
  const std::string png =
      test::make_png(2, 1, 8, 3, false, std::string("\0\0\1", 3),
                     std::string("\x0A\x14\x1E\x28\x32\x3C"), std::string("\x80\xFF"));
  const std::vector<std::uint8_t> expected{10, 20, 30, 128, 40, 50, 60, 255};
  CHECK(reading(png).samples == expected);
  CHECK(reading(with_png_chunk(png, png_chunk("tEXt", "k"))).samples == expected);
}

TEST_CASE("APP segments and comments of a JPEG are never kept", "[image]") {
  const std::string jpeg = image_file(".jpg");
  const auto samples = reading(jpeg).samples;
  for (const char marker : {'\xE1', '\xE2', '\xED', '\xFE', '\xEE'}) {
    std::string many;
    while (many.size() < kMuch) many += jpeg_segment(marker, std::string(65533, 'x'));
    check_small(jpeg.substr(0, 2) + many + jpeg.substr(2), samples);
  }
}

namespace {

/// From above to below.
std::string targa(int type, std::uint32_t width, std::uint32_t height, int bits,
                  const std::string& texels, const std::string& text = "") {
  return std::string{static_cast<char>(text.size()), '\0', static_cast<char>(type)} +
         std::string(9, '\0') + little_endian(width, 2) + little_endian(height, 2) +
         std::string{static_cast<char>(bits), bits == 32 ? '\x28' : '\x20'} + text + texels;
}

std::string targa_refusal(const std::string& file) {
  try {
    test::read_all(in_memory(file, "a.tga"), 1000, kAllowed);
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    return e.what();
  }
  return "nothing";
}

std::vector<std::uint8_t> targa_samples(const std::string& file) {
  return test::read_all(in_memory(file, "a.tga"), 1000, kAllowed);
}

}  // namespace

TEST_CASE("a Targa with a palette is refused", "[image]") {
  // Four colours, and indices of 8 and 16 bits beyond them (CVE-2023-22845).
  for (const int type : {1, 9}) {
    for (const int bits : {8, 16, 24, 32}) {
      std::string file = targa(type, 64, 64, bits, std::string(64 * 64 * 4, '\xF0'));
      file[1] = 1;
      file.replace(3, 5, std::string("\0\0\4\0\x18", 5));
      CHECK_THAT(targa_refusal(file),
                 Contains("a.tga: Targa images with a palette") && Contains("convert it to PNG"));
      file[1] = 0;  // with type 1 an ICO begins so
      CHECK_THAT(targa_refusal(file), Contains(type == 1 ? "ICO images are not supported"
                                                         : "Targa images with a palette"));
    }
  }
  CHECK_THAT(targa_refusal(targa(3, 2, 2, 16, std::string(8, 'x'))), Contains("type 3 with 16"));
  CHECK_THAT(targa_refusal(targa(32, 2, 2, 8, std::string(8, 'x'))),
             Contains("not an image in a supported format"));
}

TEST_CASE("of a Targa header and texels are read, and nothing behind them", "[image]") {
  const std::string texels("\1\2\3\4\5\6\7\x8\x9\xA\xB\xC", 12);
  const std::vector<std::uint8_t> rgb{3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10};
  CHECK(targa_samples(targa(2, 2, 2, 24, texels)) == rgb);
  CHECK(targa_samples(targa(2, 2, 2, 24, texels, "a text")) == rgb);
  // Texts without end in an extension that begins within the texels (CVE-2023-24473).
  const std::string footer =
      little_endian(18, 4) + little_endian(0, 4) + std::string("TRUEVISION-XFILE.\0", 18);
  const std::string texts(600, 'x');
  CHECK(targa_samples(targa(2, 2, 2, 24, texels) + texts + footer) == rgb);
  // Packets: three texels alike, then one by itself.
  const std::string packets("\x82\1\2\3\0\4\5\6", 8);
  CHECK(targa_samples(targa(10, 2, 2, 24, packets) + footer) ==
        std::vector<std::uint8_t>{3, 2, 1, 3, 2, 1, 3, 2, 1, 6, 5, 4});
  CHECK(targa_samples(targa(3, 2, 2, 8, "abcd")) == std::vector<std::uint8_t>{97, 98, 99, 100});
  CHECK(targa_samples(targa(11, 2, 2, 8, "\x83z")) == std::vector<std::uint8_t>(4, 122));
  CHECK(targa_samples(targa(2, 1, 1, 32, "\1\2\3\x80")) == std::vector<std::uint8_t>{3, 2, 1, 128});

  CHECK_THAT(targa_refusal(targa(2, 2, 2, 24, texels.substr(1))), Contains("truncated"));
  CHECK_THAT(targa_refusal(targa(10, 2, 2, 24, packets.substr(1))), Contains("truncated"));
  CHECK_THAT(targa_refusal(targa(11, 2, 2, 8, "\x84z")), Contains("do not match its size"));
}

TEST_CASE("a JPEG of more than 500 scans is refused unread", "[image]") {
  // Grey, progressive: the first scan has what there is (DC), further ones refine nothing.
  const std::string table = jpeg_segment('\xDB', std::string(1, '\0') + std::string(64, '\1'));
  const std::string frame = jpeg_segment('\xC2', std::string("\x08\0\x08\0\x08\1\1\x11\0", 9));
  const std::string huffman =
      jpeg_segment('\xC4', std::string(1, '\0') + std::string("\1", 1) + std::string(15, '\0') +
                               std::string(1, '\0')) +
      jpeg_segment('\xC4', std::string(1, '\x10') + std::string("\1", 1) + std::string(15, '\0') +
                               std::string(1, '\0'));
  const auto scan = [](char from, char to) {
    return jpeg_segment('\xDA', std::string{'\1', '\1', '\0', from, to, '\0'}) + '\x7F';
  };
  const auto of_scans = [&](int scans) {
    std::string file = "\xFF\xD8" + table + frame + huffman + scan('\0', '\0');
    for (int i = 1; i < scans; ++i) file += scan('\1', '\x3F');
    return file + "\xFF\xD9";
  };
  CHECK_THAT(refusal(of_scans(501)), Contains("more than 500 scans"));
  CHECK_THAT(refusal(of_scans(65535)), Contains("more than 500 scans"));
  CHECK(reading(of_scans(500)).samples.size() == 64);
  CHECK(reading(of_scans(10)).samples == std::vector<std::uint8_t>(64, 128));
}

TEST_CASE("what says how a JPEG's colours are coded is found behind others' segments", "[image]") {
  const std::string jpeg = image_file(".jpg");
  const std::string bare = jpeg.substr(0, 2) + jpeg.substr(4 + 16);  // without JFIF's segment
  const std::string adobe = jpeg_segment('\xEE', std::string("Adobe\0\x64\0\0\0\0\0", 12));
  const auto with = [&](const std::string& segments) {
    return reading(bare.substr(0, 2) + segments + bare.substr(2)).samples;
  };
  const auto coded = with("");
  const auto rgb = with(adobe);  // its transform is 0: the components are red, green and blue
  REQUIRE(rgb != coded);
  const std::string foreign = jpeg_segment('\xEE', "FotoWare") + jpeg_segment('\xEE', "Ad");
  CHECK(with(foreign) == coded);
  CHECK(with(foreign + adobe) == rgb);
  CHECK(with(adobe + foreign) == rgb);
  // The last one counts, as without a guard.
  const std::string ycc = jpeg_segment('\xEE', std::string("Adobe\0\x64\0\0\0\0\1", 12));
  CHECK(with(adobe + foreign + ycc) == coded);
  // JFIF is always YCbCr, whatever Adobe says.
  const std::string jfif = jpeg.substr(2, 18);
  REQUIRE(jfif.substr(4, 4) == "JFIF");
  CHECK(with(jpeg_segment('\xE0', "AVI1") + jfif + adobe) == coded);
}

// Fuzzing found it: memcpy() to nowhere, were it of no bytes, is undefined.
TEST_CASE("a chunk without bytes is read into no buffer", "[image]") {
  io::ByteSource source(in_memory("some bytes"));
  CHECK(source.read_at(3, nullptr, 0) == 0);
  CHECK(source.failure() == 0);
}

TEST_CASE("profiles and EXIF of a WebP are never read", "[image]") {
  // 16 x 16 texels of one colour, as libwebp writes them.
  const std::string picture = kWebpChunk;
  const auto riff = [](const std::string& chunks) {
    return "RIFF" + little_endian(chunks.size() + 4, 4) + "WEBP" + chunks;
  };
  const auto chunk = [](const std::string& type, const std::string& data) {
    return type + little_endian(data.size(), 4) + data + (data.size() % 2 == 1 ? " " : "");
  };
  const auto samples = reading(riff(picture)).samples;
  REQUIRE(samples.size() == 768);
  const std::string all = std::string("\x2C\0\0\0\x0F\0\0\x0F\0\0", 10);
  const std::string much(kMuch + 1, 'x');
  check_small(riff(chunk("VP8X", all) + chunk("ICCP", much) + picture + chunk("EXIF", much)),
              samples);
}

TEST_CASE("fields of a TIFF that make no pixels are never read", "[image]") {
  const std::string tiff = image_file(".tif");
  const auto samples = reading(tiff).samples;
  for (const int tag : {270, 305, 700, 33723, 34377, 34675, 37724, 60001}) {
    CAPTURE(tag);
    check_small(
        with_tiff_field(tiff, static_cast<std::uint16_t>(tag), 7, kMuch, std::string(kMuch, 'x')),
        samples);
  }
  // EXIF and GPS directories, wherever they may lead.
  check_small(with_tiff_field(tiff, 34665, 4, 1, "xxxx"), samples);
  check_small(with_tiff_field(tiff, 347, 7, kMuch, std::string(kMuch, 'x')), samples);
}

TEST_CASE("a TIFF in too many parts is refused unread", "[image]") {
  const std::string tiff = image_file(".tif");
  // 65536 x 65536 texels in tiles of 16 x 16.
  std::string huge = with_tiff_field(with_tiff_field(tiff, 322, 4, 1, ""), 323, 4, 1, "");
  const auto set = [&](int tag, std::uint64_t value) {
    const std::size_t at = huge.rfind(little_endian(static_cast<std::uint64_t>(tag), 2) +
                                      std::string("\4\0\1\0\0\0", 6));
    const std::size_t narrow = huge.rfind(little_endian(static_cast<std::uint64_t>(tag), 2) +
                                          std::string("\3\0\1\0\0\0", 6));
    const std::size_t place = at == std::string::npos ? narrow : at;
    REQUIRE(place != std::string::npos);
    huge.replace(place + 2, 2, little_endian(4, 2));
    huge.replace(place + 8, 4, little_endian(value, 4));
  };
  set(256, 65536);
  set(257, 65536);
  set(322, 16);
  set(323, 16);
  CHECK_THAT(refusal(huge), Contains("has 16777216 tiles"));
  // More places than the size asks for.
  const std::string places((std::size_t{1} << 24) * 4, '\0');
  CHECK_THAT(refusal(with_tiff_field(huge, 324, 4, 1 << 24, places)), Contains("16777216 tiles"));
}

TEST_CASE("an EXR header that is larger than any in use is refused unread", "[image]") {
  const std::string exr = image_file(".exr", Depth::half);
  CHECK_THAT(refusal(with_exr_attribute(exr, 2'000'000'000, "")),
             Contains("\"manifest\"") && Contains("2000000000 bytes"));
  CHECK_THAT(refusal(with_exr_attribute(exr, kMuch, std::string(kMuch, 'x'))),
             Contains("the limit of 8 MiB for headers"));
}

TEST_CASE("an EXR that promises more chunks than it can list is refused unread", "[image]") {
  std::string exr = image_file(".exr", Depth::half);
  const std::size_t at = exr.find("compression");
  exr[at + 28] = 0;  // none: a chunk per row
  const std::size_t window = exr.find("dataWindow");
  exr.replace(window + 33, 4, little_endian(60000, 4));
  CHECK_THAT(refusal(exr), Contains("60001 chunks"));
  exr.replace(window + 33, 4, little_endian(1'000'000'000, 4));
  CHECK_THAT(refusal(exr), Contains("each side must be 1 to 65536"));
}

TEST_CASE("a BMP with run lengths is not unpacked before it is read", "[image]") {
  const auto three = [](bool grey) {
    const io::ImageReader reader(in_memory(run_length_bmp(300, 2, 8, bmp_palette(grey))),
                                 {kAllowed});
    CHECK(reader.info().decoder_bytes >= 600);
    return reader.info().channels;
  };
  CHECK(three(false) == 3);
  CHECK(three(true) == 3);
  const auto samples = reading(run_length_bmp(300, 2, 8, bmp_palette(true))).samples;
  std::vector<std::uint8_t> rows(1800, 0);
  std::fill_n(rows.begin(), 900, std::uint8_t{1});  // from below to above
  CHECK(samples == rows);
  const auto coloured = reading(run_length_bmp(300, 2, 8, bmp_palette(false))).samples;
  CHECK(std::vector<std::uint8_t>(coloured.begin(), coloured.begin() + 3) ==
        std::vector<std::uint8_t>{1, 5, 1});

  const std::string much = run_length_bmp(kMuch / 4096, 4096, 8, bmp_palette(true));
  const mesh::ImageRef image = in_memory(much);
  const std::uint64_t before = test::reset_peak_rss();
  const io::ImageReader reader(image, {kAllowed});
  CHECK(test::peak_rss() - std::min(before, test::peak_rss()) < kMuch / 3);
  CHECK(reader.info().decoder_bytes > kMuch);
}

TEST_CASE("a BMP with run lengths and no palette, or of too many texels, is refused", "[image]") {
  CHECK_THAT(refusal(run_length_bmp(30, 2, 24, "")), Contains("header cannot be read"));
  std::string huge = run_length_bmp(30, 2, 8, bmp_palette(true));
  huge.replace(18, 8, little_endian(65536, 4) + little_endian(65536, 4));
  CHECK_THAT(refusal(huge), Contains("65536 x 65536 texels is too large; convert it to PNG"));
}
