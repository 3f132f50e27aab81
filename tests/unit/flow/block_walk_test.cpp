// SPDX-License-Identifier: Apache-2.0
//
// The join of boxes and a source's blocks, over a store of four blocks whose places are worked out
// by hand.
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "flow/project/page_projector.h"

using namespace pounce;
using namespace pounce::flow;

namespace {

/// From `from` to `to` along x; 0 to 1 along the others.
Box3f along_x(float from, float to) { return {{from, 0, 0}, {to, 1, 1}}; }

/// A cache of blocks that are their own names. Counts what is read.
struct Shelf {
  using Entry = store::SplatEntry;
  using Block = std::string;
  using Index = std::vector<Entry>;
  struct Store {
    struct {
      std::vector<store::SplatTile> tiles;
    } listed;
    const auto& directory() const { return listed; }
  };

  Store shelf;
  std::vector<Index> indexes;
  mutable std::vector<std::uint32_t> read;  ///< tiles whose index was read, in order

  void add_tile(const Box3f& box, const std::vector<Entry>& entries) {
    store::SplatTile tile;
    tile.box = box;
    shelf.listed.tiles.push_back(tile);
    indexes.push_back(entries);
  }
  const Store& store() const { return shelf; }
  std::shared_ptr<const Index> index(std::uint32_t tile) const {
    read.push_back(tile);
    return std::make_shared<Index>(indexes[tile]);
  }
  std::shared_ptr<const Block> block(const Entry& entry) const {
    return std::make_shared<Block>(std::to_string(entry.splats));
  }
};

store::SplatEntry entry(std::uint32_t name, float from, float to) {
  store::SplatEntry made;
  made.splats = name;
  made.box = along_x(from, to);
  return made;
}

Shelf four_blocks() {
  Shelf shelf;
  shelf.add_tile(along_x(0, 2), {entry(1, 0, 1), entry(2, 1.5F, 2)});
  shelf.add_tile(along_x(10, 11), {entry(3, 10, 11)});
  shelf.add_tile(along_x(4, 5), {entry(4, 4, 5)});
  return shelf;
}

std::vector<std::uint32_t> met(const Shelf& shelf, const std::vector<Box3f>& boxes) {
  std::vector<std::uint32_t> names;
  for (BlockWalk walk(shelf, boxes); !walk.done(); walk.next())
    names.push_back(walk.entry()->splats);
  return names;
}

using Names = std::vector<std::uint32_t>;

TEST_CASE("a walk meets the blocks that some box overlaps, in the store's order") {
  const Shelf shelf = four_blocks();
  CHECK(met(shelf, {along_x(0.5F, 0.6F)}) == Names{1});
  CHECK(met(shelf, {along_x(1, 1.5F)}) == Names{1, 2});  // boxes are closed: touching is meeting
  CHECK(met(shelf, {along_x(1.1F, 1.4F)}).empty());      // within the tile, between its blocks
  CHECK(met(shelf, {along_x(4, 10), along_x(0, 0)}) == Names{1, 3, 4});
  CHECK(met(shelf, {along_x(4.5F, 4.6F), along_x(4.5F, 4.6F)}) == Names{4});  // once
}

TEST_CASE("a walk reads the index of no tile beside its region") {
  const Shelf shelf = four_blocks();
  met(shelf, {along_x(4, 5)});
  CHECK(shelf.read == Names{2});
  shelf.read.clear();
  // Between the two boxes lies nothing of them, but their region holds the third tile.
  CHECK(met(shelf, {along_x(0, 0.1F), along_x(10.5F, 12)}) == Names{1, 3});
  CHECK(shelf.read == Names{0, 1, 2});
}

TEST_CASE("a walk without boxes, or without tiles, is done at once") {
  const Shelf shelf = four_blocks(), empty;
  CHECK(met(shelf, {}).empty());
  CHECK(shelf.read.empty());
  BlockWalk walk(empty, {along_x(0, 100)});
  CHECK(walk.done());
  CHECK(walk.entry() == nullptr);
  CHECK(walk.take(100, [](const auto&) { return std::uint64_t{1}; }).empty());
}

TEST_CASE("blocks are taken up to a limit, at least one") {
  const Shelf shelf = four_blocks();
  BlockWalk walk(shelf, {along_x(0, 100)});
  CHECK(walk.region() == along_x(0, 100));
  const auto ten_each = [](const store::SplatEntry&) { return std::uint64_t{10}; };
  const auto taken = [&](std::uint64_t most) {
    std::string names;
    for (const auto& block : walk.take(most, ten_each)) names += *block;
    return names;
  };
  CHECK(taken(25) == "12");  // a third would be 30
  CHECK(taken(1) == "3");    // more than the limit, but one
  CHECK(taken(10) == "4");
  CHECK(walk.done());
  CHECK(taken(100).empty());
}

TEST_CASE("the boxes at a block are those that meet it") {
  const Shelf shelf = four_blocks();
  const std::vector<Box3f> boxes{along_x(0, 0.5F), along_x(1.6F, 1.7F), along_x(0.9F, 4)};
  const BlockWalk walk(shelf, boxes);
  REQUIRE(walk.entry()->splats == 1);
  CHECK(walk.boxes_at(*walk.entry()) == std::vector<Box3f>{boxes[0], boxes[2]});
}

TEST_CASE("a block of a mesh is met by any of its boxes, not by what lies between them") {
  store::BlockEntry block;
  block.boxes = {along_x(0, 1), along_x(9, 10), along_x(20, 21)};
  block.box_count = 2;
  CHECK(meets(block, {along_x(9.5F, 9.6F)}));
  CHECK_FALSE(meets(block, {along_x(4, 5)}));
  CHECK_FALSE(meets(block, {along_x(20, 21)}));  // beyond box_count
  CHECK_FALSE(meets(block, {}));
}

}  // namespace
