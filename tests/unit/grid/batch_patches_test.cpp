// SPDX-License-Identifier: Apache-2.0
#include "grid/batch_patches.h"

#include <array>
#include <catch2/catch.hpp>
#include <set>

#include "support/random.h"

using namespace pounce;
using namespace pounce::grid;
using pounce::test::Random;

namespace {

/// Small patches at random places, each of a facet of its own.
surface::SourceBlock random_block(Random& random, std::size_t count) {
  surface::SourceBlock block;
  for (std::size_t i = 0; i < count; ++i) {
    surface::Patch patch;
    patch.centre = {random.between(-5.0F, 5.0F), random.between(-5.0F, 5.0F),
                    random.between(-5.0F, 5.0F)};
    patch.radius = random.between(0.01F, 0.5F);
    patch.box = Box3f{patch.centre, patch.centre}.grown(patch.radius);
    patch.facet = static_cast<std::uint32_t>(i);
    block.patches.push_back(patch);
    block.facets.push_back({});
  }
  return block;
}

constexpr Box3f kAll{{-100, -100, -100}, {100, 100, 100}};

}  // namespace

TEST_CASE("few patches are a list of those in the region, each as its block has it") {
  Random random(44);
  for (int round = 0; round < 50; ++round) {
    const surface::SourceBlock first = random_block(random, random.below(200)),
                               second = random_block(random, random.below(200));
    const std::array<const surface::SourceBlock*, 2> blocks{&first, &second};
    const Box3f region{{-2, -2, -2}, {3, 1, 2}};
    BatchPatches patches(blocks, region);
    REQUIRE(patches.grid() == nullptr);
    const PatchSpheres& list = patches.list();
    std::size_t at = 0;
    for (const surface::SourceBlock* block : blocks) {
      for (const surface::Patch& patch : block->patches) {
        if (!patch.box.overlaps(region)) continue;
        REQUIRE(at < list.size());
        CHECK(&list.facet(at) == &block->facets[patch.facet]);
        CHECK(Vec3f{*list.x(at), *list.y(at), *list.z(at)} == patch.centre);
        CHECK(*list.radius(at) == patch.radius);
        ++at;
      }
    }
    CHECK(at == list.size());
  }
}

TEST_CASE("more patches than a list may have are in a grid, all of them") {
  Random random(45);
  const surface::SourceBlock block = random_block(random, BatchPatches::kMostListed + 1);
  const std::array<const surface::SourceBlock*, 1> blocks{&block};
  BatchPatches patches(blocks, kAll);
  REQUIRE(patches.grid() != nullptr);
  CHECK(patches.list().size() == 0);
  std::set<const surface::Facet*> met;
  patches.grid()->query({{0, 0, 0}, {0, 0, 1}, 50, 0.1F}, 50,
                        [&](const GridItem& item) { met.insert(item.facet); });
  CHECK(met.size() == block.patches.size());
  BatchPatches fewer({}, kAll);
  CHECK(fewer.grid() == nullptr);
  CHECK(fewer.list().size() == 0);
}
