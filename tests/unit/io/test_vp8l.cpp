// SPDX-License-Identifier: Apache-2.0
#include <webp/encode.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <string>

#include "io/splats/unpack.h"
#include "support/memory_file_system.h"
#include "support/resident_memory.h"
#include "support/test_data.h"
#include "support/vp8l_builder.h"
#include "unit/io/vp8l_images.h"

using namespace pounce;
using test::BitWriter;
using test::decode;
using test::decode_by_libwebp;
using test::RandomVp8l;
using test::Rgba;
using test::vp8l_file;

namespace {

constexpr std::uint32_t argb(std::uint32_t a, std::uint32_t r, std::uint32_t g, std::uint32_t b) {
  return a << 24 | r << 16 | g << 8 | b;
}
constexpr std::uint32_t rgba(std::uint32_t a, std::uint32_t r, std::uint32_t g, std::uint32_t b) {
  return r << 24 | g << 16 | b << 8 | a;
}
/// Channel by channel, modulo 256.
std::uint32_t minus(std::uint32_t a, std::uint32_t b) {
  std::uint32_t result = 0;
  for (std::uint32_t shift = 0; shift < 32; shift += 8)
    result |= (((a >> shift) - (b >> shift)) & 0xFF) << shift;
  return result;
}

/// A check of two images that prints no pixels.
void check_same(const Rgba& image, const Rgba& expected) {
  REQUIRE(image.width == expected.width);
  REQUIRE(image.height == expected.height);
  const auto differ =
      std::mismatch(image.bytes.begin(), image.bytes.end(), expected.bytes.begin()).first;
  CHECK(differ - image.bytes.begin() == static_cast<std::ptrdiff_t>(image.bytes.size()));
}

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

TEST_CASE("an image of one pixel is decoded from its bits", "[vp8l]") {
  BitWriter out;
  out.put(0, 3);  // no transform, no cache, one group of codes
  for (const std::uint32_t symbol : {7U, 200U, 1U, 90U}) {
    out.put(1, 2);  // simple, one symbol
    out.put(1, 1);  // of eight bits
    out.put(symbol, 8);
  }
  out.put(0b0001, 4);  // simple, one symbol, of one bit: 0
  const Rgba image = decode(vp8l_file(1, 1, out.bytes()));
  CHECK(image.at(0, 0) == 0xC807015A);
}

TEST_CASE("each predictor predicts what is worked out by hand", "[vp8l]") {
  constexpr std::uint32_t left = argb(200, 10, 100, 255), above = argb(100, 20, 201, 250),
                          corner = argb(50, 30, 0, 5), right = argb(1, 40, 255, 128);
  const auto [predictor, expected] = GENERATE(table<std::uint32_t, std::uint32_t>({
      {0, rgba(255, 0, 0, 0)},
      {1, rgba(200, 10, 100, 255)},
      {2, rgba(100, 20, 201, 250)},
      {3, rgba(1, 40, 255, 128)},
      {4, rgba(50, 30, 0, 5)},
      {5, rgba(100, 22, 189, 220)},  // of (100, 25, 177, 191) and above
      {6, rgba(125, 20, 50, 130)},
      {7, rgba(150, 15, 150, 252)},
      {8, rgba(75, 25, 100, 127)},
      {9, rgba(50, 30, 228, 189)},
      {10, rgba(87, 25, 139, 159)},
      {11, rgba(200, 10, 100, 255)},  // 506 from above to corner, 520 from left to corner
      {12, rgba(250, 0, 255, 255)},   // 250, 0, 301, 500
      {13, rgba(200, 8, 225, 255)},   // 150 + 50, 15 - 7, 150 + 75, 252 + 123
  }));
  CAPTURE(predictor);
  BitWriter out;
  out.put(0b001, 3);  // a transform: predictors
  out.put(0, 3);      // of blocks of 4 x 4
  test::put_image(out, {argb(255, 0, predictor, 0)});
  // The top row is predicted from the left, the left column from above, beginning with black.
  test::put_main_image(out, {minus(corner, 0xFF000000), minus(above, corner), minus(right, above),
                             minus(left, corner), 0, 0});
  const Rgba image = decode(vp8l_file(3, 2, out.bytes()));
  CHECK(image.at(0, 0) == rgba(50, 30, 0, 5));
  CHECK(image.at(1, 0) == rgba(100, 20, 201, 250));
  CHECK(image.at(2, 0) == rgba(1, 40, 255, 128));
  CHECK(image.at(0, 1) == rgba(200, 10, 100, 255));
  CHECK(image.at(1, 1) == expected);
  // To the right of the last column there is the first pixel of the row itself.
  if (predictor == 3) CHECK(image.at(2, 1) == rgba(200, 10, 100, 255));
}

TEST_CASE("colours are put together again as worked out by hand", "[vp8l]") {
  BitWriter out;
  SECTION("from their shares in each other") {
    out.put(0b011, 3);
    out.put(0, 3);
    test::put_image(out, {argb(255, 64, 240, 32)});  // red to blue, green to blue, green to red
    test::put_main_image(out, {argb(3, 10, 200, 100)});
    // Green is -56: red + 32 * -56 / 32 = 210, or -46; blue + -16 * -56 / 32 + 64 * -46 / 32.
    CHECK(decode(vp8l_file(1, 1, out.bytes())).at(0, 0) == rgba(3, 210, 200, 36));
  }
  SECTION("from green") {
    out.put(0b101, 3);
    test::put_main_image(out, {argb(9, 250, 10, 3)});
    CHECK(decode(vp8l_file(1, 1, out.bytes())).at(0, 0) == rgba(9, 4, 10, 13));
  }
  SECTION("from a palette of two, eight pixels in one") {
    out.put(0b111, 3);
    out.put(2 - 1, 8);
    test::put_image(out, {argb(250, 1, 2, 3), argb(10, 255, 1, 1)});  // the second is a difference
    test::put_main_image(out, {argb(255, 0, 0b10110010, 0), argb(255, 0, 1, 0)});
    const Rgba image = decode(vp8l_file(9, 1, out.bytes()));
    for (std::uint32_t x = 0; x < 9; ++x) {
      CAPTURE(x);
      CHECK(image.at(x, 0) == (0b110110010 >> x & 1 ? rgba(4, 0, 3, 4) : rgba(250, 1, 2, 3)));
    }
  }
  SECTION("from a palette of three; what is not in it is clear") {
    out.put(0b111, 3);
    out.put(3 - 1, 8);
    test::put_image(out, {argb(1, 1, 1, 1), argb(1, 0, 0, 0), argb(1, 0, 0, 0)});
    test::put_main_image(out, {argb(255, 0, 0b11'00'01'10, 0)});
    const Rgba image = decode(vp8l_file(4, 1, out.bytes()));
    CHECK(image.at(0, 0) == rgba(3, 1, 1, 1));
    CHECK(image.at(1, 0) == rgba(2, 1, 1, 1));
    CHECK(image.at(2, 0) == rgba(1, 1, 1, 1));
    CHECK(image.at(3, 0) == 0);
  }
}

TEST_CASE("each of the 120 near pixels can be copied", "[vp8l]") {
  constexpr std::uint32_t kSide = 20;
  // 255 literals and the copy of one pixel.
  std::vector<std::uint8_t> greens(280);
  std::fill_n(greens.begin(), 255, std::uint8_t{8});
  greens[256] = 8;
  const test::CodeGroup group{test::CodeWriter(greens), test::CodeWriter::flat(256),
                              test::CodeWriter::flat(256), test::CodeWriter::flat(256),
                              test::CodeWriter::flat(40, 16)};
  BitWriter out;
  out.put(0, 3);
  test::describe(out, group);
  for (std::uint32_t i = 0; i < 280; ++i) test::put_pixel(out, group, argb(i >> 8, i & 255, 9, 3));
  for (std::uint32_t code = 1; code <= 120; ++code) {
    group[0].put(out, 256);
    // 5 and 6 share symbol 4, 97 to 128 symbol 13: the bits after it say which.
    std::uint32_t symbol = code - 1, bits = 0, first = code;
    for (std::uint32_t s = 4; s < 16; ++s) {
      const std::uint32_t begin = ((2 + (s & 1)) << ((s - 2) / 2)) + 1;
      if (code >= begin) symbol = s, bits = (s - 2) / 2, first = begin;
    }
    group[4].put(out, symbol);
    out.put(code - first, bits);
  }
  const std::string file = vp8l_file(kSide, kSide, out.bytes());
  const Rgba image = decode(file);
  check_same(image, decode_by_libwebp(file).value());
  CHECK(image.at(0, 14) == image.at(0, 13));    // code 1: above
  CHECK(image.at(1, 14) == image.at(0, 14));    // code 2: to the left
  CHECK(image.at(2, 14) == image.at(1, 13));    // code 3: both
  CHECK(image.at(19, 19) == image.at(11, 12));  // code 120: 8 to the left, 7 up
}

TEST_CASE("near pixels that a narrow image has not are the one before", "[vp8l]") {
  // In an image one pixel wide, above and one to the right is the pixel itself.
  std::vector<std::uint8_t> greens(280);
  greens[20] = greens[256] = 1;
  const test::CodeGroup group{test::CodeWriter(greens), test::CodeWriter::flat(256),
                              test::CodeWriter::single(256, 0), test::CodeWriter::single(256, 1),
                              test::CodeWriter::flat(40, 16)};
  BitWriter out;
  out.put(0, 3);
  test::describe(out, group);
  for (const std::uint32_t red : {50U, 60U}) test::put_pixel(out, group, argb(1, red, 20, 0));
  group[0].put(out, 256);
  group[4].put(out, 3);  // number 4
  CHECK(decode(vp8l_file(1, 3, out.bytes())).at(0, 2) == rgba(1, 60, 20, 0));
}

TEST_CASE("random streams of every feature are decoded as libwebp does", "[vp8l]") {
  std::map<std::string, int> met;
  for (std::uint32_t seed = 0; seed < 150; ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    const std::uint32_t width = 1 + static_cast<std::uint32_t>(random() % (seed % 4 == 0 ? 9 : 90));
    const std::uint32_t height = 1 + static_cast<std::uint32_t>(random() % 60);
    const RandomVp8l stream(seed, {width, height});
    const auto expected = decode_by_libwebp(stream.file());
    REQUIRE(expected);
    check_same(decode(stream.file()), *expected);
    for (const auto& [what, times] : stream.met()) met[what] += times;
  }
  for (const char* what : {"transform 0",
                           "transform 1",
                           "transform 2",
                           "transform 3",
                           "several transforms",
                           "palette of 1 in one",
                           "palette of 2 in one",
                           "palette of 4 in one",
                           "palette of 8 in one",
                           "colour cache",
                           "no colour cache",
                           "cached colour",
                           "groups",
                           "more than 256 groups",
                           "near copy",
                           "near copy in a narrow image",
                           "far copy",
                           "copy over itself",
                           "simple code",
                           "code of one symbol",
                           "long codes",
                           "longest codes",
                           "repeated lengths",
                           "single lengths",
                           "lengths left out"}) {
    CAPTURE(what);
    CHECK(met[what] > 5);
  }
  for (int predictor = 0; predictor < 14; ++predictor)
    CHECK(met["predictor " + std::to_string(predictor)] > 5);
}

TEST_CASE("copies reach back as far as the format lets them", "[vp8l]") {
  std::map<std::string, int> met;
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    CAPTURE(seed);
    // Rows as long as they may be, and such that the ring's end lies within a row.
    const std::uint32_t width = seed == 1 ? 16384 : 1501, height = seed == 1 ? 80 : 900;
    const RandomVp8l stream(seed, {width, height, true});
    check_same(decode(stream.file()), decode_by_libwebp(stream.file()).value());
    for (const auto& [what, times] : stream.met()) met[what] += times;
  }
  CHECK(met["copy from almost 2^20 pixels back"] > 5);
}

TEST_CASE("pictures that libwebp encodes come back", "[vp8l]") {
  std::mt19937 random(7);
  const int width = 173, height = 91;
  const std::string kind = GENERATE(as<std::string>{}, "smooth", "noise", "few colours", "clear");
  CAPTURE(kind);
  Rgba picture{173, 91, std::vector<std::uint8_t>(4 * 173 * 91)};
  for (int i = 0; i < width * height; ++i) {
    const int x = i % width, y = i / width;
    for (int c = 0; c < 4; ++c) {
      const int noise = static_cast<int>(random() & 255) | (c == 3 ? 1 : 0);
      const int smooth = ((x * (c + 1) + y * y / 50 + (noise & 3)) & 255) | (c == 3 ? 1 : 0);
      const int few = (x / 30 + y / 20) % 5 * 40 + c;
      picture.bytes[static_cast<std::size_t>(4 * i + c)] =
          static_cast<std::uint8_t>(kind == "noise"             ? noise
                                    : kind == "few colours"     ? few
                                    : kind == "clear" && c == 3 ? 0
                                                                : smooth);
    }
  }
  std::uint8_t* encoded = nullptr;
  const std::size_t size =
      WebPEncodeLosslessRGBA(picture.bytes.data(), width, height, 4 * width, &encoded);
  REQUIRE(size > 0);
  const std::string file(reinterpret_cast<const char*>(encoded), size);
  WebPFree(encoded);
  const Rgba image = decode(file);
  check_same(image, decode_by_libwebp(file).value());
  // The encoder does not keep colours that cannot be seen.
  if (kind != "clear") check_same(image, picture);
}

TEST_CASE("the images of real scenes are decoded as libwebp does", "[vp8l][external]") {
  const auto data = test::test_data();
  if (!data) return;
  std::size_t images = 0;
  for (const char* scene : {"splats/playbot_lod0_sog", "splats/playcanvas_logo_sog_v1"}) {
    for (const auto& entry : std::filesystem::directory_iterator(*data / scene)) {
      if (entry.path().extension() != ".webp") continue;
      CAPTURE(entry.path());
      const std::string bytes = read_file(entry.path());
      check_same(decode(bytes), decode_by_libwebp(bytes).value());
      ++images;
    }
  }
  const auto files = test::make_memory_file_system();
  const auto scratch = files->create_scratch("/");
  for (const char* bundle : {"captures/angel.sog", "captures/narcissus.sog"}) {
    const std::string path = (*data / bundle).string();
    const std::string bytes = read_file(path);
    const auto file = posix_file_system().open(path);
    for (const io::StoredEntry& entry : io::read_stored_zip(*file, path)) {
      if (!entry.name.ends_with(".webp")) continue;
      CAPTURE(path, entry.name);
      check_same(decode(*file, entry.at, entry.bytes, entry.name, *scratch),
                 decode_by_libwebp(bytes.substr(entry.at, entry.bytes)).value());
      ++images;
    }
  }
  CHECK(images == 22);
}

TEST_CASE("memory does not grow with the number of pixels", "[vp8l][memory]") {
  // One colour takes no bits at all, so that this is quick.
  const auto file_of = [](std::uint32_t height) {
    BitWriter out;
    out.put(0, 3);
    for (int i = 0; i < 5; ++i) out.put(0b0001, 4);
    return vp8l_file(4096, height, out.bytes());
  };
  const auto peak_of = [&](std::uint32_t height) {
    const std::string bytes = file_of(height);
    const auto files = test::make_memory_file_system();
    files->create("a.webp")->append(std::as_bytes(std::span(bytes)));
    const auto file = files->open("a.webp");
    const auto scratch = files->create_scratch("/");
    std::vector<std::uint8_t> row(4 * 4096);
    const std::uint64_t before = test::reset_peak_rss();
    io::Vp8lDecoder decoder(*file, io::read_vp8l_header(*file, 0, bytes.size(), "a"), "a",
                            *scratch);
    for (std::uint32_t y = 0; y < height; ++y) decoder.read_row(row);
    CHECK(decoder.memory_bytes() < (5 << 20));
    CHECK(std::all_of(row.begin(), row.end(), [](std::uint8_t byte) { return byte == 0; }));
    return test::peak_rss() - before;
  };
  const std::uint64_t slack = 256 << 10;
  CHECK(peak_of(256) <= (5 << 20) + slack);
  CHECK(peak_of(2048) <= (5 << 20) + slack);
}
