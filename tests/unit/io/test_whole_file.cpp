// SPDX-License-Identifier: Apache-2.0
//
// Files that end where they say, and those that were cut off before.
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "io/files/finished_output.h"
#include "io/image/write.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"

using namespace pounce;
using io::is_whole_file;
using namespace std::string_literals;

namespace {

/// Noise, so that compression leaves many strips and chunks.
void write_noise(const std::string& path, std::uint32_t tile, bool levels) {
  io::ImageWriteSpec spec{300, 200, 3, io::writable_depth(path, Depth::u8)};
  spec.layout = {"", tile, levels};
  io::ImageWriter writer(path, spec);
  std::vector<std::byte> row(300UL * 3 * 4);
  std::uint32_t state = 1;
  for (std::uint32_t width = 300, height = 200;;
       width = std::max(width / 2, 1U), height = std::max(height / 2, 1U)) {
    if (width < 300) writer.next_level();
    for (std::uint32_t y = 0; y < height; ++y) {
      for (std::byte& value : row) {
        state = state * 1664525 + 1013904223;
        value = static_cast<std::byte>(state >> 26);  // small floats, never NaN
      }
      writer.write_rows(1, row.data());
    }
    if (!levels || (width == 1 && height == 1)) break;
  }
  writer.commit();
}

std::string text_of(const std::string& path) {
  std::string text(static_cast<std::size_t>(std::filesystem::file_size(path)), ' ');
  std::ifstream(path, std::ios::binary)
      .read(text.data(), static_cast<std::streamsize>(text.size()));
  return text;
}

/// Is the file whole with these bytes?
bool is_whole(const std::string& path, const std::string& bytes) {
  test::write_file(path, bytes);
  return is_whole_file(path);
}

void check_cut(const std::string& path) {
  const std::string whole = text_of(path);
  REQUIRE(whole.size() > 100);
  CHECK(is_whole(path, whole));
  for (const std::size_t size :
       {whole.size() - 1, whole.size() - 9, whole.size() / 2, std::size_t{900}, std::size_t{40},
        std::size_t{4}, std::size_t{1}, std::size_t{0}}) {
    if (size >= whole.size()) continue;
    CAPTURE(size);
    CHECK_FALSE(is_whole(path, whole.substr(0, size)));
  }
}

}  // namespace

TEST_CASE("an image is whole if it ends where it says", "[image]") {
  struct Kind {
    const char* name;
    const char* other;  ///< whose format it has, too
    std::uint32_t tile;
    bool levels;
  };
  const Kind kind = GENERATE(Kind{"a.png", "b.png", 0, false}, Kind{"a.jpg", "b.jpg", 0, false},
                             Kind{"a.jpeg", "b.jpg", 0, false}, Kind{"a.exr", "b.exr", 0, false},
                             Kind{"a.exr", "b.exr", 64, false}, Kind{"a.exr", "b.exr", 64, true},
                             Kind{"a.TIF", "b.tif", 0, false}, Kind{"a.tiff", "b.tif", 64, false},
                             Kind{"a.tif", "b.tif", 64, true}, Kind{"a.tx", "b.tif", 64, true});
  CAPTURE(kind.name, kind.tile, kind.levels);
  const test::TempFolder folder;
  const std::string path = folder.file(kind.name);
  write_noise(path, kind.tile, kind.levels);
  CHECK(is_whole_file(path));
  const std::string whole = text_of(path);
  check_cut(path);
  for (const char* other : {"b.png", "b.jpg", "b.exr", "b.tif", "b.glb", "b.gltf", "b.bin"}) {
    CAPTURE(other);
    CHECK(is_whole(folder.file(other), whole) == (std::string(other) == kind.other));
  }
}

TEST_CASE("what other programs add or leave open is told apart", "[image]") {
  const test::TempFolder folder;
  const std::string png = folder.file("a.png"), jpeg = folder.file("a.jpg");
  write_noise(png, 0, false);
  write_noise(jpeg, 0, false);
  const std::string scan = text_of(jpeg);
  CHECK(is_whole(png, text_of(png) + "added"));
  CHECK(is_whole(jpeg, scan + std::string(100, '\0')));
  // A preview in the head has an end of its own, which is not that of the picture.
  const std::string preview = "\xFF\xE1\x00\x06\xFF\xD8\xFF\xD9"s;
  const std::string with_preview = scan.substr(0, 2) + preview + scan.substr(2);
  CHECK(is_whole(jpeg, with_preview));
  CHECK_FALSE(is_whole(jpeg, with_preview.substr(0, with_preview.size() - 2)));
}

TEST_CASE("an EXR that was never finished has no places of its chunks", "[image]") {
  const test::TempFolder folder;
  const std::string path = folder.file("a.exr");
  write_noise(path, 0, false);
  std::string bytes = text_of(path);
  // 200 rows are 13 chunks of 16: the first begins behind 13 places, of which the first is its own.
  constexpr std::size_t kTable = 13 * 8;
  std::size_t table = 0;
  const auto place = [&](std::size_t at) {
    std::uint64_t value = 0;
    std::memcpy(&value, bytes.data() + at, 8);
    return value;
  };
  while (table + 8 < bytes.size() && place(table) != table + kTable) ++table;
  REQUIRE(table + 8 < bytes.size());
  SECTION("none") { std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(table), kTable, '\0'); }
  SECTION("not the last") {
    std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(table + kTable - 8), 8, '\0');
  }
  CHECK_FALSE(is_whole(path, bytes));
}

TEST_CASE("the parts of an EXR are all looked at", "[image]") {
  const test::TempFolder folder;
  const std::string path = folder.file("a.exr");
  std::array<OIIO::ImageSpec, 2> specs;
  const bool tiled = GENERATE(false, true);
  for (std::size_t i = 0; i < 2; ++i) {
    specs[i] = OIIO::ImageSpec(70, 50, 3, OIIO::TypeDesc::HALF);
    specs[i].attribute("oiio:subimagename", i == 0 ? "one" : "two");
    if (tiled) specs[i].tile_width = specs[i].tile_height = 32;
  }
  auto output = OIIO::ImageOutput::create(path);
  REQUIRE(output->open(path, 2, specs.data()));
  const std::vector<float> texels(70UL * 50 * 3, .5F);
  REQUIRE(output->write_image(OIIO::TypeDesc::FLOAT, texels.data()));
  const bool appended = output->open(path, specs[1], OIIO::ImageOutput::AppendSubimage);
  INFO(output->geterror());
  REQUIRE(appended);
  REQUIRE(output->write_image(OIIO::TypeDesc::FLOAT, texels.data()));
  REQUIRE(output->close());
  check_cut(path);
}

TEST_CASE("a TIFF of the other byte order is read as it is", "[image]") {
  // One directory of two fields: a strip of 4 bytes at 46, which are the last.
  const std::string head = "MM\0*\0\0\0\x08\0\x02"s;
  const std::string place = "\x01\x11\0\x04\0\0\0\x01\0\0\0\x2E"s;
  const std::string length = "\x01\x17\0\x03\0\0\0\x01\0\x04\0\0"s;
  const std::string all = head + place + length + "\0\0\0\0"s + std::string(8, ' ') + "abcd";
  REQUIRE(all.size() == 50);
  const test::TempFolder folder;
  CHECK(is_whole(folder.file("a.tif"), all));
  CHECK_FALSE(is_whole(folder.file("a.tif"), all.substr(0, 49)));
  std::string circle = all;
  circle[37] = '\x08';  // its next directory is itself
  CHECK(is_whole(folder.file("a.tif"), circle));
}

TEST_CASE("a model is whole if it is as long as it says, or closes what it opens", "[model]") {
  test::GltfBuilder b;
  b.primitive({{"POSITION", b.add<float>({0, 0, 0, 1, 0, 0, 0, 2, 0}, "VEC3")}});
  const test::TempFolder folder;
  const std::string path = b.write_glb(folder.file("m.glb"));
  check_cut(path);
  CHECK(is_whole(folder.file("m.gltf"), "{\"asset\":{}}\n"));
  CHECK_FALSE(is_whole(folder.file("m.gltf"), "{\"asset\":{}"));
  CHECK_FALSE(is_whole(folder.file("m.gltf"), ""));
}

TEST_CASE("what is no file is no whole one", "[image]") {
  const test::TempFolder folder;
  CHECK_FALSE(is_whole_file(folder.file("absent.png")));
  std::filesystem::create_directory(folder.file("folder.png"));
  CHECK_FALSE(is_whole_file(folder.file("folder.png")));
}
