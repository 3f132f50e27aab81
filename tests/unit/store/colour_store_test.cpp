// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/colour_store.h"

#include <catch2/catch.hpp>

#include "store/cache/store_folder.h"
#include "support/bytes.h"
#include "support/memory_file_system.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::store;
using mesh::Wrap;
using pounce::test::Random;

namespace {

ColourDirectory image(std::uint32_t channels, Depth depth) {
  ColourDirectory d;
  d.width = 130;
  d.height = 65;
  d.channels = channels;
  d.depth = depth;
  return d;
}

std::vector<std::byte> random_tile(Random& random, const ColourDirectory& d) {
  std::vector<std::byte> tile(std::size_t{kColourTileEdge} * kColourTileEdge * d.texel_bytes());
  for (std::byte& b : tile) b = static_cast<std::byte>(random.bits());
  return tile;
}

}  // namespace

TEST_CASE("coordinates outside an image mean the texel its wrap mode says") {
  struct Row {
    std::int64_t texel, repeat, mirror, clamp;
  };
  // An image of three texels: 0 1 2.
  for (const Row& row : std::vector<Row>{{-7, 2, 0, 0},
                                         {-6, 0, 0, 0},
                                         {-5, 1, 1, 0},
                                         {-4, 2, 2, 0},
                                         {-3, 0, 2, 0},
                                         {-2, 1, 1, 0},
                                         {-1, 2, 0, 0},
                                         {0, 0, 0, 0},
                                         {1, 1, 1, 1},
                                         {2, 2, 2, 2},
                                         {3, 0, 2, 2},
                                         {4, 1, 1, 2},
                                         {5, 2, 0, 2},
                                         {6, 0, 0, 2},
                                         {7, 1, 1, 2},
                                         {8, 2, 2, 2},
                                         {9, 0, 2, 2},
                                         {3000000000, 0, 0, 2},
                                         {-3000000001, 2, 0, 0}}) {
    CAPTURE(row.texel);
    CHECK(wrapped(row.texel, 3, Wrap::repeat) == row.repeat);
    CHECK(wrapped(row.texel, 3, Wrap::mirror) == row.mirror);
    CHECK(wrapped(row.texel, 3, Wrap::clamp) == row.clamp);
  }
  for (const Wrap wrap : {Wrap::repeat, Wrap::mirror, Wrap::clamp}) {
    for (std::int64_t texel = -5; texel <= 5; ++texel) CHECK(wrapped(texel, 1, wrap) == 0);
  }
}

TEST_CASE("a filtered tile comes back for every depth and number of channels") {
  Random random(9);
  for (const Depth depth : {Depth::u8, Depth::u16, Depth::half, Depth::float32}) {
    for (std::uint32_t channels = 1; channels <= 4; ++channels) {
      const ColourDirectory d = image(channels, depth);
      const auto tile = random_tile(random, d);
      std::vector<std::byte> raw, back(tile.size());
      filter_colours(d, tile, raw);
      CHECK(raw != tile);
      unfilter_colours(d, raw, back);
      CHECK(back == tile);
    }
  }
}

TEST_CASE("samples that were not finite are counted, never more than there are") {
  const auto files = test::make_memory_file_system();
  const auto folder = StoreFolder::make_scratch(*files, "/scratch");
  Compressor compressor;
  const auto read_back = [&](Depth depth, std::uint64_t nonfinite) {
    ColourDirectory d = image(3, depth);
    d.nonfinite = nonfinite;
    ColourStoreWriter writer(folder->create(PackKind::colour, {3, 4}), d.tiles_y());
    for (std::uint32_t row = 0; row < d.tiles_y(); ++row)
      writer.add_row(row, std::vector<std::vector<std::byte>>(d.tiles_x()), 0, compressor);
    const ColourStore store(folder->publish(writer.finish(d, compressor)), d, compressor, true);
    return store.directory().nonfinite;
  };
  const ColourDirectory d = image(3, Depth::half);
  const std::uint64_t samples = std::uint64_t{d.width} * d.height * 3;
  CHECK(read_back(Depth::half, samples) == samples);
  CHECK(read_back(Depth::float32, 1) == 1);
  const auto kind = [&](Depth depth, std::uint64_t nonfinite) {
    return test::error_kind([&] { read_back(depth, nonfinite); });
  };
  CHECK(kind(Depth::half, samples + 1) == test::kDamaged);
  CHECK(kind(Depth::u16, 1) == test::kDamaged);
  CHECK(kind(Depth::u8, 1) == test::kDamaged);
}

TEST_CASE("a colour store gives back its tiles whatever order the rows came in") {
  Random random(10);
  const auto files = test::make_memory_file_system();
  const auto folder = StoreFolder::make_scratch(*files, "/scratch");
  Compressor compressor;
  ColourDirectory d = image(3, Depth::u16);
  d.linear = true;
  d.wrap_u = Wrap::mirror;
  d.wrap_v = Wrap::clamp;
  REQUIRE(d.tiles_x() == 3);
  REQUIRE(d.tiles_y() == 2);
  ColourStoreWriter writer(folder->create(PackKind::colour, {3, 4}), d.tiles_y());
  std::vector<std::vector<std::vector<std::byte>>> tiles(2);
  for (const std::uint32_t row : {1U, 0U}) {
    std::vector<std::vector<std::byte>> stored_row;
    for (std::uint32_t x = 0; x < 3; ++x) {
      tiles[row].push_back(random_tile(random, d));
      // Some are filtered and compressed, others as they are: a pack may have both.
      const std::vector<std::byte>& tile = tiles[row].back();
      PlainRoom room = x == 1 ? tile.size() : 0;
      encode_tile(d, tile, compressor, kZstdLevel, &room, stored_row.emplace_back());
      CHECK(is_as_is(stored_row.back()) == (x == 1));
    }
    writer.add_row(row, stored_row, static_cast<std::uint32_t>(tiles[row].back().size()),
                   compressor);
  }
  const ColourStore store(folder->publish(writer.finish(d, compressor)), d, compressor);
  const ColourDirectory& read = store.directory();
  CHECK(read.width == 130);
  CHECK(read.height == 65);
  CHECK(read.channels == 3);
  CHECK(read.depth == Depth::u16);
  CHECK(read.linear);
  CHECK_FALSE(read.has_alpha);
  CHECK(read.wrap_u == Wrap::mirror);
  CHECK(read.wrap_v == Wrap::clamp);
  CHECK(read.nonfinite == 0);
  for (std::uint32_t row = 0; row < 2; ++row) {
    const auto chunks = store.read_row(row, compressor);
    REQUIRE(chunks.size() == 3);
    for (std::uint32_t x = 0; x < 3; ++x) {
      const ColourTile tile = store.read_tile(chunks[x], compressor);
      CHECK(std::vector<std::byte>(tile.begin(), tile.end()) == tiles[row][x]);
    }
  }
  // 68 * 68 texels of 6 bytes in whole pages.
  CHECK(store.tile_bytes() == 7 * 4096);
  ChunkRef wrong = store.read_row(0, compressor)[0];
  wrong.raw_bytes += 1;
  CHECK(test::error_kind([&] { store.read_tile(wrong, compressor); }) == test::kDamaged);
}
