// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/geometry_store.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "store/cache/store_folder.h"
#include "support/bytes.h"
#include "support/memory_file_system.h"
#include "unit/store/random_block.h"

using namespace pounce;
using namespace pounce::store;
using pounce::test::Random;

namespace {

Box3f random_box(Random& random, float size) {
  Box3f box;
  const auto at = [&] { return random.between(-10.0F, 10.0F); };
  box.lo = {at(), at(), at()};
  const auto reach = [&] { return random.one_in(5) ? 0.0F : random.between(0.0F, size); };
  box.hi = {box.lo.x + reach(), box.lo.y + reach(), box.lo.z + reach()};
  return box;
}

bool contains(const Box3f& outer, const Box3f& inner) {
  return outer.lo.x <= inner.lo.x && outer.lo.y <= inner.lo.y && outer.lo.z <= inner.lo.z &&
         outer.hi.x >= inner.hi.x && outer.hi.y >= inner.hi.y && outer.hi.z >= inner.hi.z;
}

}  // namespace

TEST_CASE("a geometry store gives back its tiles, blocks and directory") {
  Random random(6);
  const auto files = test::make_memory_file_system();
  const auto folder = StoreFolder::make_scratch(*files, "/scratch");
  Compressor compressor;
  GeometryStoreWriter writer(folder->create(PackKind::geometry, {1, 2}));
  constexpr std::uint32_t kTriangles = 1000;
  const std::vector<std::size_t> tile_sizes{3, 1, 20};
  std::vector<std::vector<BlockEntry>> entries;
  std::vector<std::vector<std::vector<std::byte>>> raws;
  std::uint32_t most_triangles = 0, largest = 0;
  for (const std::size_t blocks : tile_sizes) {
    entries.emplace_back();
    raws.emplace_back();
    for (std::size_t b = 0; b < blocks; ++b) {
      GeometryBlock block = test::random_block(random, false, false, false);
      block.page = static_cast<std::uint32_t>(entries.size() - 1);  // one page per tile
      for (Vec3f& normal : block.normals) normal = {0, 0, 1};
      for (std::uint32_t& id : block.ids) id %= kTriangles;
      std::vector<std::byte> raw, stored;
      encode(block, raw);
      compressor.compress(raw, stored);
      BlockEntry entry{block.page, block.x, block.y, {}, 0, 99, {}, 0, {}};
      entry.triangles = static_cast<std::uint32_t>(block.triangles.size());
      entry.patches = std::min(9U, entry.triangles);
      entry.box_count = static_cast<std::uint32_t>(1 + random.below(kMostBoxesPerBlock));
      for (std::uint32_t i = 0; i < entry.box_count; ++i) entry.boxes[i] = random_box(random, 3);
      writer.add_block(entry, stored, static_cast<std::uint32_t>(raw.size()));
      most_triangles = std::max(most_triangles, entry.triangles);
      largest = std::max(largest, static_cast<std::uint32_t>(raw.size()));
      entries.back().push_back(entry);
      raws.back().push_back(std::move(raw));
    }
    writer.end_tile(compressor);
  }
  writer.end_tile(compressor);  // nothing since the last one: no tile
  GeometryDirectory directory;
  directory.pages = {{64, 32, 0, {}}, {8, 8, 1, {2, 0.5, 0.25, -1, 3, 7}}, {}, {1, 2, 3, {}}};
  directory.page_texels = {5, 1ULL << 40, 7, 9};
  directory.texels = (1ULL << 40) + 21;
  directory.overlapping = 2;
  directory.slivers = 3;
  directory.degenerate = 4;
  directory.coincident = 5;
  const GeometryStore store(folder->publish(writer.finish(directory, compressor)),
                            {false, directory.pages, kTriangles, kTriangles}, compressor);

  const GeometryDirectory& read = store.directory();
  CHECK(read.pages == directory.pages);
  CHECK(read.page_texels == directory.page_texels);
  CHECK(read.texels == (1ULL << 40) + 21);
  CHECK(read.overlapping == 2);
  CHECK(read.slivers == 3);
  CHECK(read.degenerate == 4);
  CHECK(read.coincident == 5);
  CHECK(read.most_triangles == most_triangles);
  CHECK(read.most_patches == 9);
  CHECK(read.most_blocks == 20);
  CHECK(read.largest_chunk_bytes == largest);
  REQUIRE(read.tiles.size() == 3);
  Box3f whole;
  for (std::uint32_t t = 0; t < 3; ++t) {
    const auto index = store.read_index(t, compressor);
    REQUIRE(index.size() == tile_sizes[t]);
    Box3f tile_box;
    for (std::size_t b = 0; b < index.size(); ++b) {
      const BlockEntry& expected = entries[t][b];
      CHECK(index[b].page == expected.page);
      CHECK(index[b].x == expected.x);
      CHECK(index[b].y == expected.y);
      CHECK(index[b].patches == expected.patches);
      CHECK(index[b].texels == 99);
      REQUIRE(index[b].box_count == expected.box_count);
      CHECK(index[b].boxes == expected.boxes);
      tile_box.extend(index[b].box());
      std::vector<std::byte> raw;
      encode(store.read_block(index[b], compressor), raw);
      CHECK(raw == raws[t][b]);
    }
    CHECK(read.tiles[t].box == tile_box);
    whole.extend(tile_box);
  }
  CHECK(read.box == whole);

  // The index of one block with the place of another is not believed.
  BlockEntry wrong = store.read_index(0, compressor)[0];
  wrong.chunk = store.read_index(0, compressor)[1].chunk;
  CHECK(test::error_kind([&] { store.read_block(wrong, compressor); }) == test::kDamaged);
}

TEST_CASE("clustered boxes hold every box, are at most eight, and are tighter than one") {
  Random random(8);
  for (int round = 0; round < 300; ++round) {
    std::vector<Box3f> boxes;
    const std::uint64_t count = 1 + random.below(200);
    const float size = random.one_in(2) ? 0.1F : 8.0F;
    for (std::uint64_t i = 0; i < count; ++i) boxes.push_back(random_box(random, size));
    if (random.one_in(4)) boxes.assign(boxes.size(), boxes.front());  // all alike
    const auto original = boxes;
    BlockEntry entry;
    cluster_boxes(boxes, entry);
    REQUIRE(entry.box_count >= 1);
    REQUIRE(entry.box_count <= kMostBoxesPerBlock);
    Box3f all;
    for (const Box3f& box : original) {
      all.extend(box);
      const bool held = std::any_of(entry.boxes.begin(), entry.boxes.begin() + entry.box_count,
                                    [&](const Box3f& cluster) { return contains(cluster, box); });
      if (!held) FAIL("a box is in no cluster, round " << round);
    }
    CHECK(entry.box() == all);
  }
  BlockEntry none;
  std::vector<Box3f> empty;
  cluster_boxes(empty, none);
  CHECK(none.box_count == 0);
}

TEST_CASE("two charts far apart get a box each") {
  std::vector<Box3f> boxes;
  for (int i = 0; i < 10; ++i) {
    const float x = static_cast<float>(i % 2 * 100), y = static_cast<float>(i) * 0.1F;
    boxes.push_back({{x, y, 0}, {x + 1, y + 1, 0}});
  }
  BlockEntry entry;
  cluster_boxes(boxes, entry);
  for (std::uint32_t i = 0; i < entry.box_count; ++i)
    CHECK(entry.boxes[i].hi.x - entry.boxes[i].lo.x == 1);
}
