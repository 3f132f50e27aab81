// SPDX-License-Identifier: Apache-2.0
//
// Results of a page of 130x70 texels, three blocks by two, that come in no order.
#include <catch2/catch.hpp>

#include "flow/project/results.h"
#include "support/bytes.h"
#include "unit/flow/small_target.h"

using namespace pounce;
using namespace pounce::flow;
using test::small_target;
using test::SmallJob;

namespace {

constexpr mesh::Lattice kPage{130, 70, 0, {}};
constexpr Hash128 kKey{1, 2};
using Bytes = std::vector<std::byte>;

/// A block's place, and a byte for each channel: 0 where it covers nothing.
struct Done {
  std::int32_t x, y;
  std::uint32_t texels;
  std::vector<unsigned> channels;
};

Bytes raw_of(unsigned value) { return Bytes(100, static_cast<std::byte>(value)); }

PieceWork work_of(SmallJob& job, const std::vector<Done>& blocks) {
  PieceWork work;
  work.stored.assign(2, std::vector<Bytes>(blocks.size()));
  work.raw_bytes = {100, 100};
  work.covered = work.clipped = {0, 0};
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    store::BlockEntry entry;
    entry.x = blocks[b].x;
    entry.y = blocks[b].y;
    entry.texels = blocks[b].texels;
    work.blocks.push_back(entry);
    for (std::size_t c = 0; c < 2; ++c) {
      if (blocks[b].channels[c] == 0) continue;
      job.context.compressor().compress(raw_of(blocks[b].channels[c]), work.stored[c][b]);
      work.covered[c] += blocks[b].texels;
    }
  }
  return work;
}

TEST_CASE("results are found at their blocks' places, whatever order they came in") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, {{1}});
  job.context.meter.begin("project", 100, "texels", 1);
  ResultCollector collector(job.context, target, 2, kKey);
  PieceWork late = work_of(job, {{2, 1, 7, {1, 2}}});
  PieceWork early = work_of(job, {{0, 0, 5, {3, 0}}, {1, 0, 4, {0, 0}}});
  late.distances[1] = 7, late.distance_steps = 70, late.clipped = {0, 9};
  early.distances[1] = 2, early.distances[2] = 3, early.distance_steps = 8, early.clipped = {4, 1};
  CHECK(collector.store(late) == late.stored[0][0].size() + late.stored[1][0].size());
  CHECK(collector.store(early) == early.stored[0][0].size());

  const PageResult page = collector.finish();
  REQUIRE(page.blocks.size() == 2);
  const auto value_at = [&](std::size_t c, std::size_t slot) -> unsigned {
    const store::ChunkRef& chunk = page.blocks[c][slot];
    if (chunk.raw_bytes == 0) return 0;
    const Bytes raw = test::bytes_of(store::read_payload(*page.pack, chunk, store::ChunkKind::block,
                                                         1000, job.context.compressor()));
    REQUIRE(raw == raw_of(std::to_integer<unsigned>(raw.at(0))));
    return std::to_integer<unsigned>(raw[0]);
  };
  const std::vector<std::vector<unsigned>> expected{{3, 0, 0, 0, 0, 1}, {0, 0, 0, 0, 0, 2}};
  for (std::size_t c = 0; c < 2; ++c) {
    REQUIRE(page.blocks[c].size() == 6);
    for (std::size_t slot = 0; slot < 6; ++slot) {
      CAPTURE(c, slot);
      CHECK(value_at(c, slot) == expected[c][slot]);
    }
  }
  CHECK(page.covered == std::vector<std::uint64_t>{12, 7});
  CHECK(page.clipped == std::vector<std::uint64_t>{4, 10});
  CHECK(page.distances[0] == 0);
  CHECK(page.distances[1] == 9);
  CHECK(page.distances[2] == 3);
  CHECK(page.distance_steps == 78);
}

TEST_CASE("a block that comes twice means a damaged target") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, {{1}});
  job.context.meter.begin("project", 100, "texels", 1);
  ResultCollector collector(job.context, target, 2, kKey);
  collector.store(work_of(job, {{1, 1, 3, {1, 0}}}));
  collector.store(work_of(job, {{1, 1, 3, {0, 1}}}));  // another channel of the block
  CHECK(test::error_kind([&] {
          collector.store(work_of(job, {{1, 1, 3, {1, 0}}}));
        }) == test::kDamaged);
}

TEST_CASE("the index of results is leased: a place per block and channel") {
  // And a bit per block: whether it is made.
  CHECK(store::ResultIndex::size_bytes(kPage, 2) == 6 * 2 * sizeof(store::ChunkRef) + 8);
  CHECK(store::ResultIndex::size_bytes({64, 64, 0, {}}, 1) == sizeof(store::ChunkRef) + 8);
  CHECK(store::ResultIndex::size_bytes({65, 1, 0, {}}, 1) == 2 * sizeof(store::ChunkRef) + 8);
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, {{1}});
  const ResultCollector collector(job.context, target, 2, kKey);
  CHECK(job.context.budget.leased() == store::ResultIndex::size_bytes(kPage, 2));
}

}  // namespace
