// SPDX-License-Identifier: Apache-2.0
//
// What our reader says of how a file lays its texels out: tiles and levels.
#include <catch2/catch.hpp>
#include <utility>

#include "io/codec/sample.h"
#include "io/codec/tiff_directory.h"
#include "io/image/read.h"
#include "io/image/write.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;

namespace {

/// The header and directories of a TIFF whose images have these sizes, in one of its four dialects;
/// there are no pixels. `last_link`: what stands where the chain ends.
std::string directories(const std::vector<std::pair<int, int>>& sizes, bool big_endian, bool big,
                        std::uint64_t last_link = 0) {
  std::string out = big_endian ? "MM" : "II";
  const auto put = [&](std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i)
      out += static_cast<char>(value >> 8 * (big_endian ? size - 1 - i : i));
  };
  const int word = big ? 8 : 4;
  put(big ? 43 : 42, 2);
  if (big) {
    put(8, 2);
    put(0, 2);
  }
  put(static_cast<std::uint64_t>(big ? 16 : 8), word);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    put(3, big ? 8 : 2);
    // One as a short, one as a long, and a compression, which is no size.
    put(256, 2), put(3, 2), put(1, word);
    put(static_cast<std::uint64_t>(sizes[i].first), 2), put(0, word - 2);
    put(257, 2), put(4, 2), put(1, word);
    put(static_cast<std::uint64_t>(sizes[i].second), 4), put(0, word - 4);
    put(259, 2), put(3, 2), put(1, word), put(1, 2), put(0, word - 2);
    put(i + 1 < sizes.size() ? out.size() + static_cast<std::size_t>(word) : last_link, word);
  }
  return out;
}

std::uint32_t levels_in(const std::string& bytes) {
  io::ByteSource source(test::in_memory(bytes));
  return io::tiff_levels(source);
}

/// Such an image, with all of its levels or without.
io::ImageInfo written(const std::string& path, std::uint32_t tile_size, bool mipmap) {
  io::ImageWriteSpec spec{150, 70, 1, io::writable_depth(path, Depth::u8), false, false};
  spec.layout = {"", tile_size, mipmap};
  const std::vector<std::byte> rows(150 * 70 * 4);
  io::ImageWriter writer(path, spec);
  writer.write_rows(70, rows.data());
  for (std::uint32_t height : {35U, 17U, 8U, 4U, 2U, 1U, 1U}) {
    if (!mipmap) break;
    writer.next_level();
    writer.write_rows(height, rows.data());
  }
  writer.commit();
  CHECK(test::read_all(test::at_path(path)).size() ==
        std::size_t{150} * 70 * io::sample_bytes(spec.depth));
  return io::ImageReader(path).info();
}

}  // namespace

TEST_CASE("an image's tiles and levels are known", "[image][tiles]") {
  const std::string ending = GENERATE(".tx", ".tif", ".exr");
  CAPTURE(ending);
  const test::TempFolder folder;
  const io::ImageInfo levels = written(folder.file("levels" + ending), 32, true);
  CHECK(levels.tile_width == 32);
  CHECK(levels.tile_height == 32);
  CHECK(levels.levels == 8);
  const io::ImageInfo tiles = written(folder.file("tiles" + ending), 48, false);
  CHECK(tiles.tile_width == 48);
  CHECK(tiles.tile_height == 48);
  CHECK(tiles.levels == 1);
  const io::ImageInfo rows = written(folder.file("rows" + ending), 0, false);
  CHECK(rows.tile_width == 0);
  CHECK(rows.tile_height == 0);
  CHECK(rows.levels == 1);
}

TEST_CASE("a TIFF's levels are images of half the size, in every dialect", "[image][tiles]") {
  const bool big_endian = GENERATE(false, true), big = GENERATE(false, true);
  CAPTURE(big_endian, big);
  const auto count = [&](const std::vector<std::pair<int, int>>& sizes) {
    return levels_in(directories(sizes, big_endian, big));
  };
  CHECK(count({{150, 70}}) == 1);
  CHECK(count({{150, 70}, {75, 35}, {37, 17}}) == 3);
  CHECK(count({{75, 5}, {38, 3}, {19, 1}}) == 3);     // rounded up
  CHECK(count({{4, 1}, {2, 1}, {1, 1}}) == 3);        // to the last one
  CHECK(count({{64, 64}, {64, 64}, {32, 32}}) == 1);  // pages of a book
  CHECK(count({{64, 64}, {32, 64}}) == 1);
  CHECK(count({{64, 64}, {32, 32}, {160, 120}}) == 2);  // a preview
  CHECK(count({{64, 64}, {32, 32}, {0, 0}}) == 2);
  CHECK(count({{1, 1}, {1, 1}}) == 1);
}

TEST_CASE("a chain of directories that is damaged ends there", "[image][tiles]") {
  const bool big = GENERATE(false, true);
  const std::vector<std::pair<int, int>> sizes{{8, 8}, {4, 4}};
  const std::string whole = directories(sizes, false, big);
  CHECK(levels_in(whole) == 2);
  CHECK(levels_in(directories(sizes, false, big, big ? 16 : 8)) == 2);  // back to its beginning
  CHECK(levels_in(directories(sizes, false, big, 0xFFFFFFF0)) == 2);    // beyond the end
  CHECK(levels_in(directories(sizes, false, big, 1)) == 2);             // into the header
  for (std::size_t size = 8; size < whole.size(); ++size)
    CHECK(levels_in(whole.substr(0, size)) <= 2);
  CHECK(levels_in("II") == 1);
}
