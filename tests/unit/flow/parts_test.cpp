// SPDX-License-Identifier: Apache-2.0
//
// A page of 130x70 texels, six blocks, whose results two tasks make and a third run assembles.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <set>

#include "core/bytes.h"
#include "flow/project/results.h"
#include "job/part_files.h"
#include "pounce/error.h"
#include "support/bytes.h"
#include "unit/flow/small_target.h"

using namespace pounce;
using namespace pounce::flow;
using test::small_target;
using test::SmallJob;

namespace {

constexpr mesh::Lattice kPage{130, 70, 0, {}};
constexpr Hash128 kKey{3, 4};
using Bytes = std::vector<std::byte>;

/// By place: 27 texels. The first three blocks are the first of two parts: their middles lie before
/// 13.5 of 27.
const std::vector<std::uint32_t> kTexels{5, 4, 6, 3, 2, 7};

Bytes raw_of(std::size_t block) { return Bytes(200, static_cast<std::byte>(block + 1)); }

struct Fixture {
  SmallJob job{1 << 20};
  store::GeometryStore target = small_target(job, kPage, {{5, 4, 6, 3, 2, 7}});
  planning::StepShare shares{{1, 2}, true};
  Fixture() {
    job.context.parts_folder = "/job/parts";
    job.context.meter.begin("project", 100, "texels", 1);
  }

  static store::BlockEntry entry(std::size_t block) {
    store::BlockEntry entry;
    entry.x = static_cast<std::int32_t>(block % 3);
    entry.y = static_cast<std::int32_t>(block / 3);
    entry.texels = kTexels[block];
    return entry;
  }
  PieceWork work_of(const std::vector<std::size_t>& blocks) {
    PieceWork work;
    work.stored.assign(1, std::vector<Bytes>(blocks.size()));
    work.raw_bytes = {200};
    work.covered = {0};
    work.clipped = {1};
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      work.blocks.push_back(entry(blocks[b]));
      if (blocks[b] == 4) continue;  // covers nothing
      job.context.compressor().compress(raw_of(blocks[b]), work.stored[0][b]);
      work.covered[0] += kTexels[blocks[b]];
    }
    return work;
  }
  ResultCollector task(std::uint32_t task, const Hash128& key = kKey) {
    return {job.context, target, 1, key, {TaskRole::share, task, &shares}};
  }
  ResultCollector assembled() {
    return {job.context, target, 1, kKey, {TaskRole::assemble, 1, &shares}};
  }
  /// Makes what was left when it was begun, in pieces of so many blocks: the `first` piece and so
  /// many. Returns how many blocks were left.
  std::size_t make(ResultCollector& results, std::size_t piece, std::size_t most = 6,
                   std::size_t first = 0) {
    std::vector<std::size_t> left;
    for (std::size_t b = 0; b < kTexels.size(); ++b) {
      if (!results.has(entry(b))) left.push_back(b);
    }
    for (std::size_t p = first; p < first + most && p * piece < left.size(); ++p) {
      const auto begin = left.begin() + static_cast<std::ptrdiff_t>(p * piece);
      const auto end =
          left.begin() + static_cast<std::ptrdiff_t>(std::min((p + 1) * piece, left.size()));
      results.store(work_of({begin, end}));
    }
    return left.size();
  }
  void check_whole() {
    ResultCollector results = assembled();
    REQUIRE(results.texels_left() == 0);
    REQUIRE(make(results, 1) == 0);
    const PageResult page = results.finish();
    CHECK(page.covered == std::vector<std::uint64_t>{25});
    for (std::size_t b = 0; b < kTexels.size(); ++b) {
      const store::ChunkRef& chunk = page.blocks[0][b];
      REQUIRE((chunk.raw_bytes == 0) == (b == 4));
      if (b != 4)
        REQUIRE(test::bytes_of(store::read_payload(*page.pack, chunk, store::ChunkKind::block, 1000,
                                                   job.context.compressor())) == raw_of(b));
    }
  }
  std::size_t parts() { return job.files->list("/job/parts").size(); }
};

}  // namespace

TEST_CASE("two tasks make a page, each its part, and a third run has all of it") {
  Fixture f;
  {
    ResultCollector first = f.task(1), second = f.task(2);
    CHECK(first.texels_left() == 15);
    CHECK(second.texels_left() == 12);
    CHECK(f.make(second, 2) == 3);
    CHECK(f.make(first, 1) == 3);
    CHECK(first.finish().covered == std::vector<std::uint64_t>{15});
    CHECK(second.finish().covered == std::vector<std::uint64_t>{10});
  }
  f.check_whole();
  SECTION("whoever comes again has nothing to do") {
    ResultCollector again = f.task(1);
    CHECK(again.texels_left() == 0);
    CHECK(f.make(again, 1) == 0);
    CHECK(again.finish().covered == std::vector<std::uint64_t>{0});
    CHECK(f.parts() == 2);
  }
  SECTION("what is not there is missed") {
    f.job.files->remove("/job/parts/" + f.job.files->list("/job/parts").front());
    const std::uint64_t left = f.assembled().texels_left();
    CHECK((left == 15 || left == 12));
  }
  SECTION("parts of other results are not looked at") {
    CHECK(f.task(1, Hash128{5, 6}).texels_left() == 15);
  }
  SECTION("sweeping leaves what says that pages are empty") {
    job::PartFiles(f.job.context, Hash128{7, 8}).note_empty();
    job::PartFiles::sweep(f.job.context);
    CHECK(f.parts() == 1);
    CHECK(job::PartFiles(f.job.context, Hash128{7, 8}).is_empty());
    CHECK_FALSE(job::PartFiles(f.job.context, kKey).is_empty());
  }
}

TEST_CASE("a task that died is gone on with as far as it came") {
  Fixture f;
  {
    ResultCollector first = f.task(1);
    f.make(first, 1, 2);
  }  // dead: never finished
  {
    ResultCollector again = f.task(1);
    CHECK(again.texels_left() == 6);
    CHECK(f.make(again, 1) == 1);
    (void)again.finish();
    ResultCollector second = f.task(2);
    f.make(second, 3);
    (void)second.finish();
  }
  f.check_whole();
}

TEST_CASE("two workers at one share cut it in their own ways, and nothing is taken twice") {
  // The first has got so far and dies, before or after the second has begun, which makes all of its
  // share; or a third, which begins when the first has made something and the second, too.
  for (std::size_t dies_after = 0; dies_after <= 3; ++dies_after) {
    for (const std::size_t piece : {1, 2, 3}) {
      for (const bool late : {false, true}) {
        Fixture f;
        {
          ResultCollector one = f.task(1);
          const std::size_t early = late ? std::min<std::size_t>(dies_after, 1) : 0;
          f.make(one, 1, early);
          ResultCollector other = f.task(1), second = f.task(2);
          f.make(one, 1, dies_after - early, early);
          f.make(other, piece);
          (void)other.finish();
          f.make(second, piece);
          (void)second.finish();
        }
        CAPTURE(dies_after, piece, late);
        f.check_whole();
      }
    }
  }
}

TEST_CASE("a part that is cut off or changed at any byte gives what is sound of it") {
  Fixture f;
  {
    ResultCollector first = f.task(1), second = f.task(2);
    f.make(first, 1);
    (void)first.finish();
    f.make(second, 1);
    (void)second.finish();
  }
  const std::string path = "/job/parts/" + f.job.files->list("/job/parts").front();
  const auto file = f.job.files->open(path);
  Bytes whole(file->size_bytes());
  file->read(0, whole);
  const auto leave = [&](std::span<const std::byte> bytes) {
    f.job.files->remove(path);
    f.job.files->create(path)->append(bytes);
  };
  std::set<std::uint64_t> lefts;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    leave(std::span(whole).first(size));
    lefts.insert(f.assembled().texels_left());
  }
  CHECK(lefts == std::set<std::uint64_t>{6, 10, 15});  // never half of a block
  for (std::size_t at = 0; at < whole.size(); ++at) {
    Bytes changed = whole;
    changed[at] ^= std::byte{1};
    leave(changed);
    REQUIRE(f.assembled().texels_left() > 0);
  }
  leave(whole);
  f.check_whole();
}
