// SPDX-License-Identifier: Apache-2.0
//
// Files in tiles, with and without levels, read back by our reader and by OpenImageIO's.
#include <OpenImageIO/imageio.h>
#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <numeric>

#include "io/codec/sample.h"
#include "io/image/write.h"
#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Matchers::Contains;
using io::ImageWriter;
using io::ImageWriteSpec;

namespace {

/// Bytes that look like noise; of floats the low ones, so that none is a NaN.
std::vector<std::uint8_t> noise(std::size_t bytes, std::uint32_t state) {
  std::vector<std::uint8_t> out(bytes);
  for (std::uint8_t& b : out)
    b = static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24);
  return out;
}

std::size_t row_bytes(const ImageWriteSpec& spec) {
  return std::size_t{spec.width} * spec.channels * io::sample_bytes(spec.depth);
}

void write_level(ImageWriter& writer, const std::vector<std::uint8_t>& samples, std::size_t row,
                 std::uint32_t together) {
  const auto height = static_cast<std::uint32_t>(samples.size() / row);
  for (std::uint32_t y = 0; y < height; y += together) {
    writer.write_rows(std::min(together, height - y),
                      reinterpret_cast<const std::byte*>(samples.data()) + y * row);
  }
}

/// Levels of an image of 8 bits as OpenImageIO reads them.
std::vector<std::vector<std::uint8_t>> levels_of(const std::string& path) {
  std::vector<std::vector<std::uint8_t>> levels;
  const auto input = OIIO::ImageInput::open(path);
  REQUIRE(input);
  for (int level = 0; input->seek_subimage(0, level); ++level) {
    const OIIO::ImageSpec spec = input->spec();
    levels.emplace_back(spec.image_bytes());
    REQUIRE(input->read_image(0, level, 0, spec.nchannels, OIIO::TypeUInt8, levels.back().data()));
  }
  return levels;
}

/// A grey image of 8 bits with all its levels, whose samples have nothing to do with each other.
std::vector<std::vector<std::uint8_t>> write_levels(const std::string& path,
                                                    std::uint32_t together = 7) {
  ImageWriteSpec spec{150, 70, 1, Depth::u8, false, false};
  spec.layout = {"", 32, true};
  spec.job = "0123456789abcdef0123456789abcdef";
  ImageWriter writer(path, spec);
  std::vector<std::vector<std::uint8_t>> levels;
  for (std::uint32_t width = spec.width, height = spec.height;;
       width = std::max(width / 2, 1U), height = std::max(height / 2, 1U)) {
    if (!levels.empty()) writer.next_level();
    levels.push_back(noise(std::size_t{width} * height, width));
    write_level(writer, levels.back(), width, together);
    if (width == 1 && height == 1) break;
  }
  writer.commit();
  return levels;
}

}  // namespace

TEST_CASE("tiles are read back sample for sample", "[image][write][tiles]") {
  const auto [ending, depth] = GENERATE(table<std::string, Depth>({{".tif", Depth::u8},
                                                                   {".tx", Depth::u16},
                                                                   {".tif", Depth::float32},
                                                                   {".exr", Depth::half},
                                                                   {".exr", Depth::float32}}));
  const auto [width, height] =
      GENERATE(table<std::uint32_t, std::uint32_t>({{53, 37}, {64, 48}, {200, 1}, {1, 130}}));
  const std::uint32_t edge = GENERATE(16U, 64U, 1024U);
  const std::uint32_t channels = GENERATE(1U, 3U);
  CAPTURE(ending, depth_name(depth), width, height, edge, channels);
  const test::TempFolder folder;
  ImageWriteSpec spec{width, height, channels, depth, depth >= Depth::half, false};
  spec.layout.tile_size = edge;
  auto samples = noise(row_bytes(spec) * height, 3);
  if (depth >= Depth::half) {  // no NaN: the sign and the highest bits of the exponent are 0
    const std::size_t size = io::sample_bytes(depth);
    for (std::size_t i = size - 1; i < samples.size(); i += size) samples[i] &= 0x3f;
  }
  const std::string path = folder.file("a" + ending);
  {
    ImageWriter writer(path, spec);
    write_level(writer, samples, row_bytes(spec), 13);
    writer.commit();
  }
  CHECK(test::read_all(test::at_path(path), 5) == samples);
  const auto input = OIIO::ImageInput::open(path);
  REQUIRE(input);
  CHECK(input->spec().tile_width == static_cast<int>(edge));
  CHECK(input->spec().tile_height == static_cast<int>(edge));
  CHECK_FALSE(input->seek_subimage(0, 1));
  CHECK_FALSE(input->seek_subimage(1, 0));
}

TEST_CASE("levels follow the image, each whole, the image first", "[image][write][tiles]") {
  const std::string ending = GENERATE(".tx", ".tif");
  const test::TempFolder folder;
  const std::string path = folder.file("a" + ending);
  const auto levels = write_levels(path);
  CHECK(levels.size() == 8);
  CHECK(levels_of(path) == levels);
  CHECK(test::read_all(test::at_path(path)) == levels.front());
  // The same bytes however rows come, and no level repeats what the first one says.
  const std::string bytes = test::read_file(path);
  write_levels(folder.file("b" + ending), 64);
  CHECK(test::read_file(folder.file("b" + ending)) == bytes);
  const std::size_t said = bytes.find("pounce:job=");
  CHECK(said != std::string::npos);
  CHECK(bytes.find("pounce:job=", said + 1) == std::string::npos);
}

TEST_CASE("what a tile has beyond the image is 0", "[image][write][tiles]") {
  const test::TempFolder folder;
  ImageWriteSpec spec{53, 100, 1, Depth::u8, false, false};
  spec.layout.tile_size = 64;
  const std::string path = folder.file("a.tif");
  {
    ImageWriter writer(path, spec);
    write_level(writer, std::vector<std::uint8_t>(5300, 7), 53, 9);
    writer.commit();
  }
  const auto input = OIIO::ImageInput::open(path);
  REQUIRE(input);
  for (const int top : {0, 64}) {
    std::vector<std::uint8_t> tile(64 * 64, 9);
    REQUIRE(input->read_tile(0, top, 0, OIIO::TypeUInt8, tile.data()));
    for (int i = 0; i < 64 * 64; ++i)
      REQUIRE(int{tile[static_cast<std::size_t>(i)]} ==
              (i % 64 < 53 && top + i / 64 < 100 ? 7 : 0));
  }
}

TEST_CASE("a TIFF is big where its levels together may need it", "[image][write][tiles]") {
  // Of floats 3708 MiB in the first level alone, a third more with all; 2930 and 3906.
  const auto [side, mipmap, version] = GENERATE(
      table<std::uint32_t, bool, int>({{18000, true, 43}, {18000, false, 42}, {16000, true, 42}}));
  const test::TempFolder folder;
  ImageWriteSpec spec{side, side, 3, Depth::float32, true, false};
  spec.layout = {"", 64, mipmap};
  ImageWriter writer(folder.file("a.tif"), spec);
  const std::vector<std::byte> row(std::size_t{side} * 12);
  for (int y = 0; y < 64; ++y) writer.write_rows(1, row.data());  // more than a stream keeps
  int seen = 0;  // in the file that has no name yet, or a hidden one
  for (const auto& open : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    const auto file = std::filesystem::read_symlink(open.path(), gone);
    if (gone || !file.string().starts_with(folder.path().string() + "/")) continue;
    seen = test::read_file(open.path())[2];
  }
  CHECK(seen == version);
}

TEST_CASE("a level that is missing, early or too large is our mistake", "[image][write][tiles]") {
  const test::TempFolder folder;
  ImageWriteSpec spec{8, 8, 1, Depth::u8, false, false};
  spec.layout = {"", 16, true};
  const std::vector<std::byte> rows(64);
  {
    ImageWriter writer(folder.file("a.tx"), spec);
    writer.write_rows(4, rows.data());
    CHECK_THROWS_AS(writer.next_level(), Error);
    writer.write_rows(4, rows.data());
    writer.next_level();
    CHECK_THROWS_AS(writer.write_rows(5, rows.data()), Error);
    CHECK_THROWS_AS(writer.commit(), Error);
  }
  CHECK(std::filesystem::is_empty(folder.path()));
}

TEST_CASE("a disk that fills up among the levels leaves the old file", "[image][write][tiles]") {
  const std::string ending = GENERATE(".tx", ".exr");
  const double share = GENERATE(0.2, 0.95);  // of the file, beyond which there is no room
  CAPTURE(ending, share);
  const test::TempFolder folder;
  const std::string path = folder.file("a" + ending);
  ImageWriteSpec spec{300, 200, 1, ending == ".exr" ? Depth::half : Depth::u8, false, false};
  spec.layout = {ending == ".exr" ? "none" : "", 32, true};
  const auto write = [&] {
    ImageWriter writer(path, spec);
    for (std::uint32_t width = spec.width, height = spec.height;;
         width = std::max(width / 2, 1U), height = std::max(height / 2, 1U)) {
      if (width < spec.width) writer.next_level();
      const std::size_t row = width * io::sample_bytes(spec.depth);
      auto samples = noise(row * height, width);
      if (spec.depth == Depth::half)
        for (std::size_t i = 1; i < samples.size(); i += 2) samples[i] &= 0x3f;
      write_level(writer, samples, row, 7);
      if (width == 1 && height == 1) break;
    }
    writer.commit();
  };
  write();
  const auto whole = static_cast<double>(std::filesystem::file_size(path));
  test::write_file(path, "an old picture");
  // A limit on file sizes stands in for the disk.
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit tight = before;
  tight.rlim_cur = static_cast<rlim_t>(whole * share);
  setrlimit(RLIMIT_FSIZE, &tight);
  std::string message = "written";
  try {
    write();
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::storage) message = error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, old_handler);
  CHECK_THAT(message, Contains("cannot write " + path) && Contains("File too large"));
  CHECK(test::read_file(path) == "an old picture");
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
}

TEST_CASE("an EXR is compressed as it is told", "[image][write][tiles]") {
  const std::string compression = GENERATE("none", "rle", "zips", "zip", "piz");
  const std::uint32_t edge = GENERATE(0U, 32U);
  const test::TempFolder folder;
  ImageWriteSpec spec{70, 40, 1, Depth::half, true, false};
  spec.layout = {compression, edge, false};
  auto samples = noise(row_bytes(spec) * spec.height, 9);
  for (std::size_t i = 1; i < samples.size(); i += 2) samples[i] &= 0x3f;
  const std::string path = folder.file("a.exr");
  ImageWriter writer(path, spec);
  write_level(writer, samples, row_bytes(spec), 40);
  writer.commit();
  CHECK(test::read_all(test::at_path(path)) == samples);
  CHECK(io::why_no_exr_compression(compression).empty());
  const auto input = OIIO::ImageInput::open(path);
  REQUIRE(input);
  CHECK(input->spec().get_string_attribute("compression") == compression);
}

TEST_CASE("compressions that lose something are refused", "[image][write][tiles]") {
  for (const char* name : {"dwaa", "dwab", "b44", "pxr24", "ZIP", "", "zip:4"})
    CHECK_THAT(io::why_no_exr_compression(name), Contains("none, rle, zips, zip or piz"));
}
