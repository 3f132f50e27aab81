// SPDX-License-Identifier: Apache-2.0
//
// Results of a page of 130x70 texels that two runs make together: the first one dies. What it left
// is cut off, changed and put under other names, at every byte.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>

#include "core/bytes.h"
#include "flow/project/results.h"
#include "support/bytes.h"
#include "unit/flow/small_target.h"

using namespace pounce;
using namespace pounce::flow;
using test::small_target;
using test::SmallJob;

namespace {

constexpr mesh::Lattice kPage{130, 70, 0, {}};
constexpr Hash128 kKey{3, 4};
const std::string kName = "/.pounce-00000000000000030000000000000004.resume";
using Bytes = std::vector<std::byte>;

struct Block {
  std::int32_t x, y;
  std::uint32_t texels;
  unsigned value;  ///< 0: covers nothing
};

Bytes raw_of(unsigned value) { return Bytes(100, static_cast<std::byte>(value)); }

PieceWork work_of(SmallJob& job, const std::vector<Block>& blocks) {
  PieceWork work;
  work.stored.assign(1, std::vector<Bytes>(blocks.size()));
  work.raw_bytes = {100};
  work.covered = work.clipped = {0};
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    store::BlockEntry entry;
    entry.x = blocks[b].x;
    entry.y = blocks[b].y;
    entry.texels = blocks[b].texels;
    work.blocks.push_back(entry);
    if (blocks[b].value == 0) continue;
    job.context.compressor().compress(raw_of(blocks[b].value), work.stored[0][b]);
    work.covered[0] += entry.texels;
    work.clipped[0] += blocks[b].value;
    work.distances[blocks[b].value] += entry.texels;
    work.distance_steps += entry.texels * blocks[b].value;
  }
  return work;
}

const std::vector<std::vector<Block>> kPieces{
    {{0, 0, 5, 1}, {1, 0, 4, 0}}, {{2, 1, 7, 2}}, {{0, 1, 3, 3}, {1, 1, 2, 4}}, {{2, 0, 6, 5}}};
constexpr std::uint64_t kTexels[] = {9, 7, 5, 6};

struct Fixture {
  SmallJob job{1 << 20};
  store::GeometryStore target = small_target(job, kPage, {{1}});
  Fixture() {
    job.context.keeps_results_after = {};
    job.context.meter.begin("project", 100, "texels", 1);
  }
  ResultCollector collector(const Hash128& key = kKey) { return {job.context, target, 1, key}; }
  /// A run that makes the first so many pieces and dies.
  void die_after(std::size_t pieces) {
    ResultCollector results = collector();
    for (std::size_t i = 0; i < pieces; ++i) results.store(work_of(job, kPieces[i]));
  }
  Bytes left() {
    const auto file = job.files->open(kName);
    Bytes bytes(file->size_bytes());
    file->read(0, bytes);
    return bytes;
  }
  void leave(std::span<const std::byte> bytes) {
    job.files->remove(kName);
    job.files->create(kName)->append(bytes);
  }
  bool is_there() { return job.files->exists(kName); }

  /// Goes on with what is there and makes the rest; checks that all is as one run makes it, and
  /// returns which pieces it found.
  std::vector<bool> go_on() {
    ResultCollector results = collector();
    std::vector<bool> found;
    std::uint64_t kept = 0;
    for (std::size_t i = 0; i < kPieces.size(); ++i) {
      const PieceWork work = work_of(job, kPieces[i]);
      found.push_back(results.has(work.blocks.front()));
      for (const store::BlockEntry& entry : work.blocks) REQUIRE(results.has(entry) == found[i]);
      kept += found[i] ? kTexels[i] : 0;
      if (!found[i]) results.store(work);
    }
    REQUIRE(results.went_on_with() == kept);
    const PageResult page = results.finish();
    REQUIRE(page.covered == std::vector<std::uint64_t>{23});
    REQUIRE(page.clipped == std::vector<std::uint64_t>{15});
    REQUIRE(page.distance_steps == 5 + 14 + 9 + 8 + 30);
    for (const auto& piece : kPieces) {
      for (const Block& block : piece) {
        if (block.value != 0) REQUIRE(page.distances[block.value] == block.texels);
        const auto slot = static_cast<std::size_t>(3 * block.y + block.x);
        const store::ChunkRef& chunk = page.blocks[0][slot];
        REQUIRE((chunk.raw_bytes == 0) == (block.value == 0));
        if (block.value == 0) continue;
        REQUIRE(test::bytes_of(store::read_payload(*page.pack, chunk, store::ChunkKind::block, 1000,
                                                   job.context.compressor())) ==
                raw_of(block.value));
      }
    }
    results.forget();
    return found;
  }
};

TEST_CASE("a run goes on from what one that died had made") {
  for (std::size_t made = 1; made <= kPieces.size(); ++made) {
    Fixture run;
    run.die_after(made);
    REQUIRE(run.is_there());
    const std::vector<bool> found = run.go_on();
    for (std::size_t i = 0; i < kPieces.size(); ++i) CHECK(found[i] == (i < made));
    CHECK_FALSE(run.is_there());  // its images are there
  }
}

TEST_CASE("a run that dies again loses nothing of the one before") {
  Fixture run;
  run.die_after(1);
  {
    ResultCollector second = run.collector();
    second.store(work_of(run.job, kPieces[2]));
  }
  {
    ResultCollector third = run.collector();
    third.store(work_of(run.job, kPieces[1]));
    third.finish();  // and died while its images were written
  }
  CHECK(run.go_on() == std::vector<bool>{true, true, true, false});
}

TEST_CASE("a pack that is cut off anywhere gives its whole pieces") {
  Fixture run;
  run.die_after(3);
  const Bytes whole = run.left();
  std::size_t before = 0;
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    CAPTURE(size);
    run.leave(std::span(whole).first(size));
    const std::vector<bool> found = run.go_on();
    const auto pieces = static_cast<std::size_t>(std::count(found.begin(), found.end(), true));
    REQUIRE(std::is_sorted(found.rbegin(), found.rend()));  // the first ones
    REQUIRE(pieces >= before);
    before = pieces;
  }
  CHECK(before == 3);
}

TEST_CASE("no changed byte of a pack is believed") {
  Fixture run;
  run.die_after(3);
  const Bytes whole = run.left();
  for (std::size_t at = 0; at < whole.size(); ++at) {
    CAPTURE(at);
    Bytes changed = whole;
    changed[at] ^= std::byte{1};
    run.leave(changed);
    const std::vector<bool> found = run.go_on();  // checks that all is right
    REQUIRE_FALSE(found[2]);                      // something before its end was changed
  }
}

TEST_CASE("another job's pack is not gone on with") {
  Fixture run;
  run.die_after(2);
  const Bytes whole = run.left();
  const Hash128 other{3, 5};
  run.job.files->create("/.pounce-00000000000000030000000000000005.resume")->append(whole);
  ResultCollector results = run.collector(other);
  CHECK(results.went_on_with() == 0);
}

TEST_CASE("a pack that somebody is at work on stays that job's") {
  Fixture run;
  ResultCollector first = run.collector();
  first.store(work_of(run.job, kPieces[0]));
  REQUIRE(run.is_there());
  {
    ResultCollector second = run.collector();
    CHECK(second.went_on_with() == 0);
    second.store(work_of(run.job, kPieces[1]));
    second.finish();
    second.forget();
  }
  CHECK(run.is_there());
  first.store(work_of(run.job, kPieces[1]));
}

TEST_CASE("an attempt that follows on damage believes nothing that was made before") {
  Fixture run;
  run.die_after(2);
  run.job.context.begins_again = true;
  CHECK(run.collector().went_on_with() == 0);
  CHECK_FALSE(run.is_there());
}

TEST_CASE("a pack that takes more than this job may is made again") {
  Fixture run;
  run.die_after(2);
  run.job.context.scratch_account =
      std::make_shared<ScratchAccount>(100, [] { return std::string("too much"); });
  run.job.context.scratch_account->adopt(101);
  CHECK(run.collector().went_on_with() == 0);
  CHECK_FALSE(run.is_there());
}

TEST_CASE("encoded rows take no room but what the job can spare") {
  Fixture run;
  run.job.context.spare_scratch_bytes = 500;
  const Hash128 first{1, 1}, second{1, 2};
  {
    ResultCollector results = run.collector();
    results.store(work_of(run.job, kPieces[0]));
    const auto kept = results.encodings(0);
    kept->put(0, first, Bytes(300));
    kept->put(1, second, Bytes(300));
    CHECK(run.job.context.spare_scratch_bytes < 200);
  }
  CHECK(run.job.context.spare_scratch_bytes == 500);
  ResultCollector results = run.collector();
  CHECK(run.job.context.spare_scratch_bytes < 200);  // what the first run kept counts
  const auto kept = results.encodings(0);
  Bytes found;
  CHECK(kept->find(0, first, found));
  CHECK(found == Bytes(300));
  CHECK_FALSE(kept->find(1, second, found));
}

TEST_CASE("a step that takes less than a second leaves nothing") {
  Fixture run;
  run.job.context.keeps_results_after = std::chrono::seconds(1);
  run.die_after(4);
  CHECK_FALSE(run.is_there());
}

/// What a record may state of a block: 1 if its chunk precedes, 0 if it covers nothing.
struct Stated {
  std::uint32_t x, y, texels;
  std::uint8_t chunk;
};

/// What is gone on with of a pack with so many chunks and a record that was made by hand.
std::uint64_t kept_of(std::size_t chunks, std::uint32_t count, const std::vector<Stated>& blocks,
                      std::size_t more_bytes = 0) {
  Fixture run;
  {
    store::PackWriter writer(run.job.files->create(kName), store::PackKind::results, kKey);
    for (std::size_t i = 0; i < chunks; ++i) writer.append(store::ChunkKind::block, Bytes(8), 100);
    Bytes record;
    ByteWriter out(record);
    out.put(count);
    for (const Stated& block : blocks) out.put_all(block.x, block.y, block.texels, block.chunk);
    for (std::size_t i = 0; i < 2 + kDistanceBins + 3; ++i) out.put(std::uint64_t{0});
    record.resize(record.size() + more_bytes);
    writer.append(store::ChunkKind::record, record, static_cast<std::uint32_t>(record.size()));
  }
  return run.collector().went_on_with();
}

TEST_CASE("a sound record that cannot be true is not believed") {
  CHECK(kept_of(1, 2, {{2, 1, 7, 1}, {0, 0, 4, 0}}) == 11);  // what can be
  CHECK(kept_of(1, 1, {{3, 1, 7, 1}}) == 0);                 // beyond the page
  CHECK(kept_of(1, 1, {{2, 2, 7, 1}}) == 0);
  CHECK(kept_of(1, 1, {{0xffffffff, 0, 7, 1}}) == 0);
  CHECK(kept_of(1, 1, {{2, 1, 4097, 1}}) == 0);             // more texels than a block has
  CHECK(kept_of(2, 2, {{2, 1, 7, 1}, {2, 1, 7, 1}}) == 0);  // one block twice
  CHECK(kept_of(1, 2, {{2, 1, 7, 1}, {0, 0, 4, 1}}) == 0);  // a chunk that is not there
  CHECK(kept_of(2, 1, {{2, 1, 7, 1}}) == 0);                // one that nobody names
  CHECK(kept_of(1, 2, {{2, 1, 7, 1}}) == 0);                // ends too early
  CHECK(kept_of(1, 1, {{2, 1, 7, 1}}, 1) == 0);             // and too late
  CHECK(kept_of(1, 0xffffffff, {{2, 1, 7, 1}}) == 0);
}

}  // namespace
