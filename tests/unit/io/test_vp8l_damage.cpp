// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <string>

#include "pounce/error.h"
#include "support/bytes.h"
#include "support/failing_file_system.h"
#include "support/memory_file_system.h"
#include "support/vp8l_builder.h"
#include "unit/io/vp8l_images.h"

using namespace pounce;
using test::BitWriter;
using test::decode;
using test::riff_chunk;
using test::riff_file;
using test::vp8l_file;

namespace {

constexpr int kInput = static_cast<int>(ErrorKind::input);

/// With which words a file is refused as bad input; "" if it is not.
std::string refusal(const std::string& bytes) {
  std::string message;
  const int kind = test::error_kind([&] { decode(bytes); }, &message);
  if (kind == 0) return "";
  CHECK(kind == kInput);
  CHECK(message.starts_with("a.webp: "));
  return message;
}

void check_refused(const std::string& bytes, const std::string& words) {
  const std::string message = refusal(bytes);
  INFO(message);
  CHECK(message.find(words) != std::string::npos);
}

std::string stream_of(const BitWriter& out) { return out.bytes() + std::string(64, '\0'); }

std::string small_file() {
  BitWriter out;
  test::put_main_image(out, {0x01020304, 0x05060708});
  return vp8l_file(2, 1, out.bytes());
}

/// Four codes of one symbol, 0, and of distances: the end of a group without copies.
void put_single_codes(BitWriter& out, int count) {
  for (int i = 0; i < count; ++i) out.put(0b0001, 4);
}

}  // namespace

TEST_CASE("what is no lossless WebP image is refused by name", "[vp8l]") {
  const std::string vp8l = small_file().substr(12);
  const auto extended = [](char flags, int width, int height) {
    return riff_chunk("VP8X", std::string(1, flags) + std::string(3, '\0') +
                                  test::little_endian(static_cast<std::uint64_t>(width - 1), 3) +
                                  test::little_endian(static_cast<std::uint64_t>(height - 1), 3));
  };
  CHECK(refusal(riff_file(vp8l)).empty());
  CHECK(refusal(riff_file(extended(0x10, 2, 1) + riff_chunk("ICCP", "odd") + vp8l)).empty());
  CHECK(refusal(riff_file(vp8l) + "behind the end").empty());
  check_refused("\x89PNG\r\n\x1A\n and more", "is not a WebP image");
  check_refused("RIFF\4", "ends after 5 of at least 12 bytes");
  check_refused(riff_file(riff_chunk("VP8 ", "data")), "is a lossy WebP image");
  check_refused(riff_file(extended(0x10, 2, 1) + riff_chunk("ALPH", "data")), "is a lossy");
  check_refused(riff_file(extended(0x02, 2, 1) + vp8l), "is an animated WebP image");
  check_refused(riff_file(riff_chunk("ANMF", vp8l)), "is an animated WebP image");
  check_refused(riff_file(extended(0, 2, 2) + vp8l), "states 2 x 2 pixels, but has 2 x 1");
  check_refused(riff_file(riff_chunk("EXIF", "x")), "without an image (");
  check_refused(riff_file(riff_chunk("VP8L", "\x2F\1\1")), "does not begin like a lossless");
  check_refused(riff_file(riff_chunk("VP8L", std::string("\x2E\0\0\0\0\0\0", 7))), "not begin");
  check_refused(riff_file(riff_chunk("VP8L", std::string("\x2F\0\0\0\x20\0\0", 7))), "version 1");
  std::string many;
  for (int i = 0; i < 64; ++i) many += riff_chunk("JUNK", "");
  check_refused(riff_file(many + vp8l), "without an image (");
}

TEST_CASE("what cannot be in a stream is refused", "[vp8l]") {
  BitWriter out;
  std::string words;
  const auto put_lengths = [&](std::vector<std::uint8_t> lengths) {
    test::CodeWriter(std::move(lengths)).describe(out);
  };
  SECTION("a transform that is there twice") {
    out.put(0b101'101, 6);
    words = "a repeated transform";
  }
  SECTION("a colour cache of one colour") {
    out.put(0b0'0000'1'0, 7);
    words = "a colour cache of 2^0 colours";
  }
  SECTION("a colour cache that is too large") {
    out.put(0b0'1100'1'0, 7);
    words = "a colour cache of 2^12 colours";
  }
  SECTION("a predictor that there is not") {
    out.put(0b000'001, 6);
    test::put_image(out, {14 << 8});
    words = "unknown predictor 14";
  }
  SECTION("codes that are too many") {
    out.put(0, 3);
    put_lengths(std::vector<std::uint8_t>(280, 8));
    words = "do not form a complete code";
  }
  SECTION("codes that are too few") {
    std::vector<std::uint8_t> lengths(280);
    std::fill_n(lengths.begin(), 255, std::uint8_t{8});
    out.put(0, 3);
    put_lengths(lengths);
    words = "do not form a complete code";
  }
  SECTION("no codes") {
    out.put(0, 3);
    put_lengths(std::vector<std::uint8_t>(280));
    words = "do not form a complete code";
  }
  SECTION("lengths without a complete code") {
    out.put(0, 3);
    out.put(0, 1);
    out.put(0, 4);
    for (const std::uint32_t length : {2U, 2U, 2U, 0U}) out.put(length, 3);
    words = "the lengths of a prefix code have no complete code";
  }
  SECTION("more lengths than symbols") {
    out.put(0, 3);
    out.put(0, 1);
    out.put(0, 4);
    for (const std::uint32_t length : {0U, 1U, 0U, 0U}) out.put(length, 3);  // 11 to 138 zeros
    out.put(0, 1);
    for (int i = 0; i < 3; ++i) out.put(127, 7);
    words = "more lengths than symbols";
  }
  SECTION("more lengths announced than symbols") {
    out.put(0, 3);
    out.put(0, 1);
    out.put(0, 4);
    for (const std::uint32_t length : {0U, 1U, 0U, 0U}) out.put(length, 3);
    out.put(1, 1);
    out.put(4, 3);
    out.put(281 - 2, 10);
    words = "more lengths than symbols";
  }
  SECTION("a distance that there is not") {
    out.put(0, 3);
    put_single_codes(out, 4);
    out.put(0b101, 3);
    out.put(40, 8);
    words = "a symbol outside of its alphabet";
  }
  check_refused(vp8l_file(4, 4, stream_of(out)), words);
}

TEST_CASE("copies from before the first pixel or beyond the last are refused", "[vp8l]") {
  // A literal, which is 0, and copies of 13 to 16 pixels from the pixel before.
  BitWriter out;
  std::vector<std::uint8_t> lengths(280);
  lengths[0] = lengths[256 + 7] = 1;
  out.put(0, 3);
  test::CodeWriter(lengths).describe(out);
  put_single_codes(out, 3);
  put_single_codes(out, 1);
  const auto put_literal = [&] { out.put(0, 1); };
  const auto put_copy = [&](std::uint32_t length) {
    out.put(1, 1);
    out.put(length - 13, 2);
  };
  SECTION("first of all") {
    put_copy(16);
    check_refused(vp8l_file(5, 4, stream_of(out)), "a copy from before the first pixel");
  }
  SECTION("from the row above the first") {
    // Distance code 1, above: five pixels back, and there are four.
    for (int i = 0; i < 4; ++i) put_literal();
    put_copy(13);
    check_refused(vp8l_file(5, 4, stream_of(out)), "a copy from before the first pixel");
  }
  SECTION("to the last pixel") {
    for (int i = 0; i < 5; ++i) put_literal();
    put_copy(15);
    CHECK(refusal(vp8l_file(5, 4, out.bytes())).empty());
  }
  SECTION("one too long") {
    for (int i = 0; i < 5; ++i) put_literal();
    put_copy(16);
    check_refused(vp8l_file(5, 4, stream_of(out)), "a copy beyond the last pixel");
  }
}

TEST_CASE("more codes than the memory for them are refused, unused ones are not kept", "[vp8l]") {
  constexpr std::uint32_t kBlocks = 128;  // each way
  BitWriter out;
  out.put(0b100, 3);  // no transform, no cache, an image of groups
  out.put(0, 3);      // of blocks of 4 x 4
  const bool used = GENERATE(true, false);
  std::vector<std::uint32_t> groups(kBlocks * kBlocks);
  for (std::uint32_t i = 0; i < groups.size(); ++i) groups[i] = used ? (i % 10'000) << 8 : 0;
  groups[5] = 9'999 << 8;
  test::put_image(out, groups);
  // Four tables of 1 KiB each.
  std::vector<std::uint8_t> lengths(256, 8);
  lengths[0] = 7;
  lengths[254] = lengths[255] = 9;
  const test::CodeWriter code(lengths);
  lengths.resize(280);
  const test::CodeWriter green(lengths);
  for (int i = 0; i < 10'000; ++i) {
    green.describe(out, true);
    for (int k = 0; k < 3; ++k) code.describe(out, true);
    put_single_codes(out, 1);
  }
  const std::uint32_t side = 4 * kBlocks;
  if (used) {
    check_refused(vp8l_file(side, side, stream_of(out)),
                  "its 10000 groups of prefix codes need more than 32 MiB");
  } else {
    // Pixels of zero bits.
    const std::string file =
        vp8l_file(side, side, out.bytes() + std::string(side * side * 4, '\0'));
    CHECK(decode(file) == test::decode_by_libwebp(file).value());
  }
}

TEST_CASE("as many groups as can be numbered are read", "[vp8l]") {
  BitWriter out;
  out.put(0b100, 3);
  out.put(0, 3);
  test::put_image(out, {0xFFFF00, 0, 0, 0xFFFF00});
  for (int i = 0; i < 65'536; ++i) put_single_codes(out, 5);
  const std::string file = vp8l_file(8, 8, out.bytes());
  CHECK(decode(file) == test::decode_by_libwebp(file).value());
}

TEST_CASE("images that end too early are refused wherever they end", "[vp8l]") {
  std::uint32_t tried = 0;
  for (std::uint32_t seed = 0; tried < 5; ++seed) {
    const std::string file = test::RandomVp8l(seed, {11, 9}).file();
    if (file.size() > 1000) continue;
    ++tried;
    CAPTURE(seed);
    const auto expected = decode(file);
    // As a download that was cut off.
    for (std::size_t size = 0; size + 1 < file.size(); ++size)
      CHECK(refusal(file.substr(0, size)).find("ends after ") != std::string::npos);
    // As a stream that is too short in a file that is whole. Its last byte is all that it may lack:
    // where an even number of bytes was filled up.
    const std::string stream = file.substr(25);
    for (std::size_t size = 0; size + 2 < stream.size(); ++size)
      check_refused(vp8l_file(11, 9, stream.substr(0, size)), "is damaged at byte ");
    CHECK(decode(vp8l_file(11, 9, stream)) == expected);
  }
}

TEST_CASE("images with wrong bytes are refused or decoded as libwebp does", "[vp8l]") {
  int refused = 0, decoded = 0, stricter = 0;
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    const std::string file = test::RandomVp8l(seed, {13, 10}).file();
    const std::size_t step = 1 + file.size() / 100;
    for (std::size_t at = 0; at < file.size(); at += step) {
      // Not the size: libwebp would be busy with large images.
      if (at > 20 && at < 25) continue;
      std::string wrong = file;
      wrong[at] = static_cast<char>(wrong[at] ^ 1 << (at + seed) % 8);
      test::Rgba image;
      std::string message;
      const int kind = test::error_kind([&] { image = decode(wrong); }, &message);
      CAPTURE(seed, at, message);
      const auto expected = test::decode_by_libwebp(wrong);
      if (kind != 0) {
        REQUIRE(kind == kInput);
        ++refused;
        stricter += expected.has_value();
      } else {
        REQUIRE(expected);
        REQUIRE(image == *expected);
        ++decoded;
      }
    }
  }
  CHECK(refused > 500);
  CHECK(decoded > 100);
  // Predictors and symbols that there are not, which libwebp makes something of.
  CHECK(stricter < 10);
}

TEST_CASE("a scratch file that fails ends the work as what it is", "[vp8l]") {
  const std::string bytes = test::RandomVp8l(0, {40, 40}).file();
  const auto files = test::make_memory_file_system();
  files->create("a.webp")->append(std::as_bytes(std::span(bytes)));
  test::FailingFileSystem failing(*files);
  const auto run = [&] {
    const auto scratch = failing.create_scratch("/");
    return decode(*failing.open("a.webp"), 0, bytes.size(), "a.webp", *scratch);
  };
  const auto expected = run();
  const std::uint64_t calls = failing.calls();
  CHECK(calls > 10);
  for (std::uint64_t call = 1; call <= calls; ++call) {
    failing.restart({call});
    CHECK(test::error_kind(run) == test::kStorage);
  }
  failing.restart({});
  CHECK(run() == expected);
}
