// SPDX-License-Identifier: Apache-2.0
//
// The splat payloads of docs/tile-format.md: its dumps are what the writers make, and a decoder
// written from that page alone gets back what went in.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>

#include "format/stranger.h"
#include "store/blocks/splat_store.h"
#include "support/hex_dump.h"
#include "support/memory_file_system.h"
#include "support/random.h"

namespace pounce::store {
namespace {

using Bytes = std::vector<std::byte>;
using test::floats;
using test::Stranger;

constexpr Hash128 kKey{0x0011223344556677u, 0x8899aabbccddeeffu};

Bytes documented(const std::string& name) {
  return test::bytes_of_hex_dump(test::documented_dump("hexdump " + name));
}

/// Two discs, one lying in the plane z = 1, one standing.
std::array<Splat, 2> example() {
  Splat lying;
  lying.mean = {1, 2, 1};
  lying.sigma = {0.5F, 0.25F, 0};
  lying.alpha = 0.75F;
  lying.colour = {1, 0.5F, 0.25F};
  Splat standing = lying;
  standing.mean.x = 1.5F;
  standing.rotation = {0, 0, 1, 0};
  standing.colour.z = -0.25F;
  return {lying, standing};
}

SplatBlock example_block() {
  const auto splats = example();
  SplatBlock block;
  block.assign(splats);
  return block;
}

TEST_CASE("the documented splat block is what the writer makes", "[format]") {
  Bytes raw;
  encode(example_block(), raw);
  CHECK(test::documented_dump("hexdump splat-block") == test::hex_dump(raw));
}

TEST_CASE("a decoder written from the page reads the documented splat block", "[format]") {
  Stranger in(documented("splat-block"));
  REQUIRE(in.u32() == 2);
  CHECK(in.u32() == 0);  // no normals
  using Floats = std::vector<float>;
  CHECK(floats(in.column(2, 1, 4)) == Floats{1, 1.5F});
  CHECK(floats(in.column(2, 1, 4)) == Floats{2, 2});
  CHECK(floats(in.column(2, 1, 4)) == Floats{1, 1});
  for (const float v : {0.5F, 0.25F, 0.0F})
    CHECK(floats(in.column(2, 1, 4, false)) == Floats{v, v});
  CHECK(floats(in.column(2, 1, 4, false)) == Floats{1, 0});  // w
  CHECK(floats(in.column(2, 1, 4, false)) == Floats{0, 0});
  CHECK(floats(in.column(2, 1, 4, false)) == Floats{0, 1});
  CHECK(floats(in.column(2, 1, 4, false)) == Floats{0, 0});
  CHECK(floats(in.column(2, 1, 4, false)) == Floats{0.75F, 0.75F});
  CHECK(floats(in.column(2, 1, 4, false)) == Floats{1, 1});
  CHECK(floats(in.column(2, 1, 4, false)) == Floats{0.5F, 0.5F});
  CHECK(floats(in.column(2, 1, 4, false)) == Floats{0.25F, -0.25F});
  CHECK(in.left() == 0);
}

TEST_CASE("a decoder written from the page reads any splat block", "[format]") {
  test::Random random(1);
  const std::size_t count = GENERATE(1U, 300U, 4096U);
  std::vector<Splat> splats(count);
  for (Splat& s : splats) {
    for (float* v : {&s.mean.x, &s.mean.y, &s.mean.z, &s.sigma.x, &s.colour.y, &s.normal.z})
      *v = random.between(-10.0F, 10.0F);
  }
  const std::uint32_t degree = GENERATE(0U, 1U, 2U, 3U);
  const std::uint32_t lobes = kLobesOfDegree[degree];
  std::vector<std::uint16_t> halves(3 * lobes * count);
  for (std::uint16_t& half : halves) half = static_cast<std::uint16_t>(random.below(0x7C00));
  SplatBlock block;
  block.assign(splats, lobes, halves);
  Bytes raw;
  encode(block, raw);
  Stranger in(raw);
  REQUIRE(in.u32() == count);
  CHECK(in.u32() == (1 | degree << 1));
  std::vector<std::vector<float>> columns;
  for (int c = 0; c < 17; ++c) columns.push_back(floats(in.column(count, 1, 4, c < 3)));
  const auto sh = in.column(halves.size(), 1, 2, false);
  for (std::size_t i = 0; i < halves.size(); ++i) {
    const std::size_t column = i / count, row = i % count;
    if (sh[i] != halves[row * 3 * lobes + column]) FAIL("coefficient " << i);
  }
  CHECK(in.left() == 0);
  for (std::size_t i = 0; i < count; ++i) {
    const Splat& s = splats[i];
    const bool same = columns[0][i] == s.mean.x && columns[1][i] == s.mean.y &&
                      columns[2][i] == s.mean.z && columns[3][i] == s.sigma.x &&
                      columns[6][i] == 1 && columns[12][i] == s.colour.y &&
                      columns[16][i] == s.normal.z;
    if (!same) FAIL("splat " << i);
  }
}

TEST_CASE("the documented splat index page and directory are what the writers make", "[format]") {
  const auto files = test::make_memory_file_system();
  Compressor compressor;
  SplatStoreWriter writer(
      std::make_unique<PackWriter>(files->create("pack"), PackKind::splats, kKey));
  SplatEntry entry;
  entry.splats = 2;
  entry.size_class = 1;
  entry.box = {{-0.5F, 1.25F, 1}, {3, 2.75F, 1}};
  writer.add_block(entry, Bytes(100), 120);  // the stored size is made up
  writer.end_tile(compressor);
  SplatDirectory directory;
  directory.filtered = {1, 0, 5, 0, 0, 2, 0, 0, 0, 0};
  directory.model = SplatModel::antialiased;
  directory.surface_noise = 0.125F;
  directory.roundness = 0.25F;
  directory.typical_size = 0.375F;
  directory.thickness = 0.625F;
  directory.middle_box = {{1, 2, 1}, {1.5F, 2, 1}};
  writer.finish(directory, compressor);
  const PackReader reader(files->open("pack"), "pack", PackKind::splats, kKey);
  const auto payload = [&](const ChunkRef& chunk, ChunkKind kind) {
    Bytes raw(chunk.raw_bytes);
    compressor.decompress(reader.read(chunk, kind).payload(), raw);
    return raw;
  };
  const Bytes raw = payload(reader.directory(), ChunkKind::directory);

  Stranger in(raw);
  CHECK(in.u32() == 1);  // tiles
  CHECK(in.u32() == 0);  // no normals
  CHECK(in.u32() == 1);  // antialiased
  CHECK(in.f32() == 0.125F);
  CHECK(in.integer(8) == 2);
  for (const std::uint64_t count : {1, 0, 5, 0, 0, 2, 0, 0, 0, 0}) CHECK(in.integer(8) == count);
  for (const unsigned v : {2U, 1U, 120U, 0U})  // the last: no harmonics
    CHECK(in.u32() == v);
  CHECK(in.f32() == 0.25F);
  CHECK(in.f32() == 0.375F);
  CHECK(in.f32() == 0.625F);
  for (const float v : {-0.5F, 1.25F, 1.0F, 3.0F, 2.75F, 1.0F}) CHECK(in.f32() == v);
  for (const float v : {1.0F, 2.0F, 1.0F, 1.5F, 2.0F, 1.0F}) CHECK(in.f32() == v);
  for (const float v : {-0.5F, 1.25F, 1.0F, 3.0F, 2.75F, 1.0F}) CHECK(in.f32() == v);
  ChunkRef page;
  page.offset = in.integer(8);
  page.stored_bytes = in.u32();
  page.raw_bytes = in.u32();
  CHECK(in.u32() == 1);  // blocks
  CHECK(in.u32() == 1);  // size class
  CHECK(in.left() == 0);

  // All but the size that zstd made of the index page.
  Bytes expected = documented("splat-directory");
  REQUIRE(expected.size() == raw.size());
  const auto stored_at = static_cast<std::ptrdiff_t>(raw.size()) - 16;
  std::copy_n(raw.begin() + stored_at, 4, expected.begin() + stored_at);
  CHECK(test::hex_dump(expected) == test::hex_dump(raw));
  CHECK(test::documented_dump("hexdump splat-index-page") ==
        test::hex_dump(payload(page, ChunkKind::index_page)));
}

}  // namespace
}  // namespace pounce::store
