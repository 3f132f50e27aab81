// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <map>

#include "io/image/write.h"
#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using test::in_memory;
using test::read_all;

namespace {

enum class Verdict { refused, same, different };

Verdict judge(const std::string& bytes, const std::vector<std::uint8_t>& expected) {
  try {
    return read_all(in_memory(bytes), 7) == expected ? Verdict::same : Verdict::different;
  } catch (const Error& error) {
    return error.kind() == ErrorKind::input ? Verdict::refused : Verdict::different;
  }
}

/// Something smooth with noise in it, 40 rows high.
std::string encode(const std::string& ending, Depth depth, std::uint32_t width = 48) {
  test::TempFolder folder;
  const std::string path = folder.file("a" + ending);
  io::ImageWriter writer(path, {width, 40, 3, depth, false, false});
  std::vector<std::uint8_t> row(std::size_t{width} * 3 * 4);
  std::uint32_t state = 3;
  for (std::uint32_t y = 0; y < 40; ++y) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      row[i] =
          static_cast<std::uint8_t>(i + 2 * y + ((state = state * 1664525U + 1013904223U) >> 29));
      if (depth == Depth::half || depth == Depth::float32) row[i] &= 0x3F;  // no NaN
    }
    writer.write_rows(1, reinterpret_cast<const std::byte*>(row.data()));
  }
  writer.commit();
  return test::read_file(path);
}

}  // namespace

TEST_CASE("an image cut off anywhere is refused or still whole, never silently wrong",
          "[image][damage]") {
  const auto [ending, depth] = GENERATE(table<std::string, Depth>(
      {{".png", Depth::u8}, {".jpg", Depth::u8}, {".tif", Depth::u8}, {".exr", Depth::half}}));
  CAPTURE(ending);
  // Each cut is a process of its own where a library decodes.
  const std::string bytes = encode(ending, depth, 20);
  const auto expected = read_all(in_memory(bytes));
  std::map<Verdict, std::size_t> count;
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    const Verdict verdict = judge(bytes.substr(0, length), expected);
    if (verdict == Verdict::different)
      FAIL_CHECK("silently wrong at " << length << " of " << bytes.size());
    ++count[verdict];
  }
  if (ending != ".tif") CHECK(count[Verdict::refused] == bytes.size());
  CHECK(count[Verdict::refused] > bytes.size() * 9 / 10);
}

TEST_CASE("no flipped bit of a PNG gives other samples without an error", "[image][damage]") {
  const std::string bytes = encode(".png", Depth::u8);
  const auto expected = read_all(in_memory(bytes));
  for (std::size_t bit = 0; bit < bytes.size() * 8; bit += 3) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    if (judge(damaged, expected) == Verdict::different) FAIL_CHECK("silently wrong at bit " << bit);
  }
}

TEST_CASE("the last checksum of a PNG counts although no row is left to read", "[image][damage]") {
  std::string png = test::make_png(2, 1, 8, 0, false, std::string("\0\x01\x02", 3));
  const std::size_t crc_of_idat = png.size() - 12 - 1;
  png[crc_of_idat] = static_cast<char>(png[crc_of_idat] ^ 1);
  CHECK_THROWS_WITH(read_all(in_memory(png, "skin.png")), Catch::Contains("skin.png") &&
                                                              Catch::Contains("IDAT") &&
                                                              Catch::Contains("row"));
}

TEST_CASE("the message about a JPEG that was cut off names the image and the rows",
          "[image][damage]") {
  const std::string bytes = encode(".jpg", Depth::u8);
  CHECK_THROWS_WITH(
      read_all(in_memory(bytes.substr(0, bytes.size() * 2 / 3), "skin.jpg"), 8),
      Catch::Contains("skin.jpg") && Catch::Contains("rows") && Catch::Contains("of 40"));
}

TEST_CASE("every broken PNG of PngSuite and the glTF validator is refused",
          "[image][damage][external]") {
  const auto data = test::test_data();
  if (!data) return;
  int broken = 0;
  for (const auto& entry : std::filesystem::directory_iterator(*data / "bad/image-png/pngsuite")) {
    if (entry.path().extension() != ".png") continue;
    CAPTURE(entry.path().string());
    CHECK_THROWS_AS(read_all(test::at_path(entry.path().string())), Error);
    ++broken;
  }
  CHECK(broken == 14);
  for (const char* name : {"invalid_image_data.jpg", "unrecognized_format.png", "png_eos.png"}) {
    CAPTURE(name);
    CHECK_THROWS_AS(read_all(test::at_path((*data / "bad/gltf_validator/image" / name).string())),
                    Error);
  }
  CHECK(read_all(test::at_path((*data / "bad/gltf_validator/image/magenta.png").string())) ==
        std::vector<std::uint8_t>{255, 0, 255});
}
