// SPDX-License-Identifier: Apache-2.0
//
// The payloads of docs/tile-format.md: its dumps are what the writers make, and a decoder written
// from that page alone, sharing no code with the library, gets back what went in.
#include <array>
#include <catch2/catch.hpp>

#include "core/directions.h"
#include "format/stranger.h"
#include "mesh/uv_raster.h"
#include "shading/result_block.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_store.h"
#include "support/bytes.h"
#include "support/hex_dump.h"
#include "support/memory_file_system.h"

namespace pounce::store {
namespace {

using Bytes = std::vector<std::byte>;
using test::floats;
using test::Stranger;

constexpr Hash128 kKey{0x0011223344556677u, 0x8899aabbccddeeffu};

Bytes documented(const std::string& name) {
  return test::bytes_of_hex_dump(test::documented_dump("hexdump " + name));
}

// --- the example: one triangle on an image of 4 x 4 texels ---

constexpr mesh::Lattice kPage{4, 4, 0, {}};

GeometryBlock example_block() {
  GeometryBlock block;
  block.positions = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
  block.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  block.uvs = {{0, 0}, {1, 0}, {0, 1}};
  block.tangents.assign(3, {32767, 0, 0, 32767});
  block.triangles = {{0, 1, 2}};
  block.ids = {7};
  block.shifts = {{0, 0}};
  block.owner.assign(kTexelsPerBlock, kNoTriangle);
  mesh::raster_triangle(block.texel_corners(kPage, 0), {0, 0, 4, 4},
                        [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
                          for (std::int64_t x = begin; x < end; ++x)
                            block.owner[static_cast<std::size_t>(y * 64 + x)] = 0;
                        });
  return block;
}

/// The pack of that block. The block's stored bytes are made up, so that the index does not depend
/// on the version of zstd.
struct ExamplePack {
  std::unique_ptr<FileSystem> files = test::make_memory_file_system();
  Compressor compressor;
  std::unique_ptr<PackReader> reader;

  ExamplePack() {
    Bytes raw;
    encode(example_block(), raw);
    GeometryStoreWriter writer(
        std::make_unique<PackWriter>(files->create("pack"), PackKind::geometry, kKey));
    BlockEntry entry;
    entry.triangles = 1;
    entry.texels = 6;
    std::vector<Box3f> boxes{{{0.5F, 0.5F, 0}, {2.5F, 2.5F, 0}}};
    cluster_boxes(boxes, entry);
    writer.add_block(entry, Bytes(100), static_cast<std::uint32_t>(raw.size()));
    writer.end_tile(compressor);
    GeometryDirectory directory;
    directory.pages = {kPage};
    directory.texels = 6;
    directory.page_texels = {6};
    writer.finish(directory, compressor);
    reader = std::make_unique<PackReader>(files->open("pack"), "pack", PackKind::geometry, kKey);
  }
  Bytes raw(const ChunkRef& chunk, ChunkKind kind) {
    Bytes raw(chunk.raw_bytes);
    compressor.decompress(reader->read(chunk, kind).payload(), raw);
    return raw;
  }
};

ColourDirectory example_image(Depth depth, std::uint32_t channels) {
  ColourDirectory image;
  image.width = 100;
  image.height = 60;
  image.channels = channels;
  image.depth = depth;
  image.wrap_v = mesh::Wrap::clamp;
  return image;
}

TEST_CASE("the documented geometry block is what the writer makes", "[format]") {
  Bytes raw;
  encode(example_block(), raw);
  CHECK(test::documented_dump("hexdump geometry-block") == test::hex_dump(raw));
}

TEST_CASE("a decoder written from the page reads the documented geometry block", "[format]") {
  Stranger in(documented("geometry-block"));
  CHECK(in.u32() == 0);  // page
  CHECK(in.i32() == 0);
  CHECK(in.i32() == 0);
  CHECK(in.u32() == 1);  // has texel runs, no shifts
  REQUIRE(in.u32() == 3);
  REQUIRE(in.u32() == 1);
  CHECK(floats(in.column(3, 3, 4)) == std::vector<float>{0, 0, 0, 4, 0, 0, 0, 4, 0});
  CHECK(floats(in.column(3, 3, 4)) == std::vector<float>{0, 0, 1, 0, 0, 1, 0, 0, 1});
  CHECK(floats(in.column(3, 2, 4)) == std::vector<float>{0, 0, 1, 0, 0, 1});
  CHECK(in.column(3, 4, 2) ==
        std::vector<std::uint32_t>{32767, 0, 0, 32767, 32767, 0, 0, 32767, 32767, 0, 0, 32767});
  CHECK(in.column(1, 3, 2) == std::vector<std::uint32_t>{0, 1, 2});
  CHECK(in.column(1, 1, 4) == std::vector<std::uint32_t>{7});
  REQUIRE(in.u32() == 6);
  // Rows of 3, 2 and 1 texels: the centres on the slanted edge belong to its other side.
  CHECK(in.column(6, 1, 2, false) == std::vector<std::uint32_t>{2, 60, 1, 61, 0, 3966});
  CHECK(in.column(6, 1, 2) == std::vector<std::uint32_t>{0, 0xFFFF, 0, 0xFFFF, 0, 0xFFFF});
  CHECK(in.left() == 0);
}

/// Four texels of a dense target: a row of three, and one below the second.
GeometryBlock example_records() {
  GeometryBlock block;
  block.x = 1;
  block.step = 0x1p-10F;
  block.owner.assign(kTexelsPerBlock, kNoTriangle);
  block.owner[10] = 0;
  block.owner[11] = 1;
  block.owner[12] = 2;
  block.owner[75] = 3;
  block.records = {{{1024, -2048, 0}, to_octahedral({0, 0, 1}), 0x3F80, {}},
                   {{3072, -2048, 2}, to_octahedral({0, 0, 1}), 0x3F80, {-3, 0, 5}},
                   {{5120, -2048, 4}, to_octahedral({0, 1, 0}), 0x3F81, {}},
                   {{3072, -4097, 2}, kNoDirection, 0x3F80, {}}};
  return block;
}

TEST_CASE("the documented records are what the writer makes", "[format]") {
  Bytes raw;
  encode(example_records(), raw);
  CHECK(test::documented_dump("hexdump geometry-records") == test::hex_dump(raw));
}

TEST_CASE("a decoder written from the page reads the documented records", "[format]") {
  Stranger in(documented("geometry-records"));
  CHECK(in.u32() == 0);  // page
  CHECK(in.i32() == 1);
  CHECK(in.i32() == 0);
  CHECK(in.u32() == 4);  // records
  CHECK(in.u32() == 0);
  CHECK(in.u32() == 0);
  CHECK(in.f32() == 0x1p-10F);
  const std::vector<bool> covered = in.coverage();
  REQUIRE(covered.size() == 4096);
  for (std::size_t t = 0; t < 4096; ++t) CHECK(covered[t] == ((t >= 10 && t <= 12) || t == 75));
  CHECK(in.expected(covered, 4) == std::vector<std::int32_t>{1024, 3072, 5120, 3072});
  CHECK(in.expected(covered, 4) == std::vector<std::int32_t>{-2048, -2048, -2048, -4097});
  CHECK(in.expected(covered, 4) == std::vector<std::int32_t>{0, 2, 4, 2});
  CHECK(in.expected(covered, 2) == std::vector<std::int32_t>{0, 0, 0, -32768});
  CHECK(in.expected(covered, 2) == std::vector<std::int32_t>{0, 0, 32767, -32768});
  CHECK(in.expected(covered, 2) == std::vector<std::int32_t>{0x3F80, 0x3F80, 0x3F81, 0x3F80});
  for (const std::uint64_t v : {0, 0xFD, 0, 0, 0, 0, 0, 0, 0, 5, 0, 0}) CHECK(in.integer(1) == v);
  CHECK(in.left() == 0);
}

TEST_CASE("the documented index page and directory are what the writers make", "[format]") {
  ExamplePack pack;
  const Bytes directory = pack.raw(pack.reader->directory(), ChunkKind::directory);
  Stranger in(directory);
  for (int i = 0; i < 2; ++i) CHECK(in.u32() == 1);       // pages, tiles
  CHECK(in.integer(8) == 6);                              // texels
  for (int i = 0; i < 3; ++i) CHECK(in.integer(8) == 0);  // overlapping, slivers, degenerate
  CHECK(in.u32() == 1);                                   // most triangles of a block
  CHECK(in.u32() == 0);                                   // most patches
  CHECK(in.u32() == 1);                                   // most blocks of a tile
  CHECK(in.u32() == 182);                                 // largest raw block
  CHECK(in.integer(8) == 0);                              // coincident
  for (const float v : {0.5F, 0.5F, 0.0F, 2.5F, 2.5F, 0.0F}) CHECK(in.f32() == v);
  for (const unsigned v : {4U, 4U, 0U}) CHECK(in.u32() == v);  // width, height, UV set
  for (int i = 0; i < 6; ++i) CHECK(in.integer(8) == (i % 4 == 0 ? 0x3FF0000000000000U : 0U));
  CHECK(in.integer(8) == 6);  // texels of the page
  for (const float v : {0.5F, 0.5F, 0.0F, 2.5F, 2.5F, 0.0F}) CHECK(in.f32() == v);
  ChunkRef page;
  page.offset = in.integer(8);
  page.stored_bytes = in.u32();
  page.raw_bytes = in.u32();
  CHECK(in.u32() == 1);  // blocks
  CHECK(in.left() == 0);

  // All but the size that zstd made of the index page.
  Bytes expected = documented("geometry-directory");
  REQUIRE(expected.size() == directory.size());
  const std::size_t stored_at = directory.size() - 12;
  std::copy_n(directory.begin() + static_cast<std::ptrdiff_t>(stored_at), 4,
              expected.begin() + static_cast<std::ptrdiff_t>(stored_at));
  CHECK(test::hex_dump(expected) == test::hex_dump(directory));
  CHECK(test::documented_dump("hexdump geometry-index-page") ==
        test::hex_dump(pack.raw(page, ChunkKind::index_page)));
}

TEST_CASE("the documented colour directory is what the writer makes", "[format]") {
  const auto files = test::make_memory_file_system();
  Compressor compressor;
  ColourStoreWriter writer(
      std::make_unique<PackWriter>(files->create("pack"), PackKind::colour, kKey), 1);
  writer.add_row(0, {Bytes(100), Bytes(92)}, 13872, compressor);
  writer.finish(example_image(Depth::u8, 3), compressor);
  const PackReader reader(files->open("pack"), "pack", PackKind::colour, kKey);
  Bytes directory(reader.directory().raw_bytes);
  compressor.decompress(reader.read(reader.directory(), ChunkKind::directory).payload(), directory);

  Bytes expected = documented("colour-directory");
  REQUIRE(expected.size() == directory.size());
  const std::size_t stored_at = directory.size() - 8;
  std::copy_n(directory.begin() + static_cast<std::ptrdiff_t>(stored_at), 4,
              expected.begin() + static_cast<std::ptrdiff_t>(stored_at));
  CHECK(test::hex_dump(expected) == test::hex_dump(directory));

  Stranger in(directory);
  for (int i = 0; i < 6; ++i) in.u32();  // to the row's index page
  in.integer(1);
  ChunkRef row;
  row.offset = in.integer(8);
  row.stored_bytes = in.u32();
  row.raw_bytes = in.u32();
  REQUIRE(in.left() == 0);
  Bytes page(row.raw_bytes);
  compressor.decompress(reader.read(row, ChunkKind::index_page).payload(), page);
  CHECK(test::documented_dump("hexdump colour-index-page") == test::hex_dump(page));
}

TEST_CASE("a decoder written from the page reads colour tiles of every kind", "[format]") {
  const auto depth = GENERATE(Depth::u8, Depth::u16, Depth::half, Depth::float32);
  const auto channels = GENERATE(1U, 2U, 3U, 4U);
  const ColourDirectory image = example_image(depth, channels);
  const auto size = static_cast<unsigned>(depth_bytes(depth));
  const Bytes tile = test::random_bytes(std::size_t{68} * 68 * channels * size, channels);
  Bytes raw;
  filter_colours(image, tile, raw);
  CAPTURE(size, channels);
  CHECK(raw.size() == tile.size());
  const auto samples = Stranger(raw).texels(std::size_t{68} * 68, channels, size);
  Bytes decoded;
  for (const std::uint32_t sample : samples) {
    for (unsigned k = 0; k < size; ++k) decoded.push_back(std::byte(sample >> (8 * k) & 0xFF));
  }
  CHECK(decoded == tile);
}

TEST_CASE("a decoder written from the page reads a result block", "[format]") {
  const shading::TexelFormat format{3, Depth::u16, false, true, false};
  shading::ResultBlock block;
  const Bytes texels = test::random_bytes(std::size_t{64} * 64 * 6, 1);
  block.texels.assign(texels.begin(), texels.end());
  for (std::uint32_t t = 0; t < 4096; t += 5) block.cover(t);
  Compressor compressor;
  Bytes stored, raw(512 + texels.size());
  REQUIRE(shading::encode(block, format, compressor, nullptr, stored) == raw.size());
  compressor.decompress(stored, raw);
  Stranger in(raw);
  for (std::uint32_t byte = 0; byte < 512; ++byte) {
    const auto bits = in.integer(1);
    for (std::uint32_t bit = 0; bit < 8; ++bit)
      CHECK((bits >> bit & 1) == ((byte * 8 + bit) % 5 == 0 ? 1 : 0));
  }
  const auto samples = in.texels(4096, 3, 2);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto expected = std::to_integer<unsigned>(texels[2 * i]) |
                          std::to_integer<unsigned>(texels[2 * i + 1]) << 8;
    if (samples[i] != expected) FAIL("sample " << i);
  }
}

namespace {

/// What a frame of blocks as they are holds, if its header states the size in eight bytes.
Bytes content_as_is(const Bytes& frame) {
  Stranger in(frame);
  CHECK(in.u32() == 0xFD2FB528);
  CHECK(in.integer(1) == 0xE0);
  const auto size = in.integer(8);
  Bytes content;
  for (bool is_last = false; !is_last;) {
    const auto header = in.integer(3);
    is_last = (header & 1) != 0;
    CHECK((header >> 1 & 3) == 0);  // a raw block
    for (std::uint64_t i = header >> 3; i > 0; --i) content.push_back(std::byte(in.integer(1)));
  }
  CHECK(in.left() == 0);
  CHECK(content.size() == size);
  return content;
}

}  // namespace

TEST_CASE("what is not compressed is as it is, marked by its size of eight bytes", "[format]") {
  Compressor compressor;
  PlainRoom room = 1 << 20;
  Bytes stored;
  const ColourDirectory image = example_image(Depth::u16, 3);
  const Bytes tile = test::random_bytes(std::size_t{68} * 68 * 6, 1);
  encode_tile(image, tile, compressor, kZstdLevel, &room, stored);
  CHECK(content_as_is(stored) == tile);

  shading::ResultBlock block;
  const Bytes texels = test::random_bytes(std::size_t{64} * 64 * 4, 2);
  block.texels.assign(texels.begin(), texels.end());
  block.cover(9);
  shading::encode(block, {4, Depth::u8, false, true, true}, compressor, &room, stored);
  Bytes expected(512);
  expected[1] = std::byte{2};
  expected.insert(expected.end(), texels.begin(), texels.end());
  CHECK(content_as_is(stored) == expected);
}

TEST_CASE("the documented example of the filters holds", "[format]") {
  // Four RGB texels, 8 bit: differences per channel, then the planes R, G, B.
  const std::array<unsigned, 12> texels{10, 20, 30, 12, 20, 29, 14, 20, 28, 14, 22, 28};
  const std::array<unsigned, 12> planes{10, 2, 2, 0, 20, 0, 0, 2, 30, 255, 255, 0};
  Bytes bytes, raw(12);
  for (const unsigned v : texels) bytes.push_back(std::byte(v));
  delta(bytes, 1, 3);
  shuffle(bytes, 3, raw);
  for (std::size_t i = 0; i < 12; ++i) CHECK(std::to_integer<unsigned>(raw[i]) == planes[i]);
}

}  // namespace
}  // namespace pounce::store
