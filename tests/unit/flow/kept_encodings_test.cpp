// SPDX-License-Identifier: Apache-2.0
//
// Encoded rows of an image that a later run may need, against what is leased for them.
#include <malloc.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "flow/project/results.h"
#include "flow/write/image_file.h"
#include "support/random.h"
#include "support/test_data.h"
#include "unit/flow/small_target.h"

using namespace pounce;
using namespace pounce::flow;

namespace {

constexpr Hash128 kKey{5, 6};

std::uint64_t allocated() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

/// What `of` does, and how much is allocated meanwhile.
class Watched final : public io::EncodedBlocks {
 public:
  explicit Watched(io::EncodedBlocks& of) : of_(of) {}
  bool find(std::uint32_t block, const Hash128& rows, std::vector<std::byte>& encoded) override {
    const bool found = of_.find(block, rows, encoded);
    found_ += found ? 1 : 0;
    most_ = std::max(most_, allocated());
    return found;
  }
  void put(std::uint32_t block, const Hash128& rows, std::span<const std::byte> encoded) override {
    of_.put(block, rows, encoded);
    ++put_;
    most_ = std::max(most_, allocated());
  }
  std::uint64_t most() const { return most_; }
  int found() const { return found_; }
  int put() const { return put_; }

 private:
  io::EncodedBlocks& of_;
  std::uint64_t most_ = 0;
  int found_ = 0, put_ = 0;
};

/// A job that dies once its image is encoded, and its files.
struct Job {
  explicit Job(const std::string& folder) : job(64 << 20) {
    job.context.files = &posix_file_system();
    job.context.scratch_folder = folder;
    job.context.scratch = store::StoreFolder::make_scratch(*job.context.files, folder);
    job.context.keeps_results_after = {};
    job.context.meter.begin("project", 1, "texels", 1);
    target.emplace(test::small_target(job, {64, 64, 0, {}}, {{1}}));
    results.emplace(job.context, *target, 1, kKey);
    // A piece that covers nothing, with which the pack gets its name.
    PieceWork work;
    work.blocks.emplace_back();
    work.stored.assign(1, std::vector<std::vector<std::byte>>(1));
    work.raw_bytes = {100};
    work.covered = work.clipped = {0};
    if (!results->has(work.blocks[0])) results->store(work);
  }
  test::SmallJob job;
  std::optional<store::GeometryStore> target;
  std::optional<ResultCollector> results;
};

TEST_CASE("encoded rows that are kept are in the lease of their image") {
  const test::TempFolder folder;
  // A row makes a block of half a MiB, and nothing deflates it: all copies are of their full size.
  const io::ImageWriteSpec spec{65536, 14, 4, Depth::u16, false, true};
  std::vector<std::byte> rows(std::size_t{spec.width} * 8 * spec.height);
  test::Random random(7);
  for (std::byte& byte : rows) byte = static_cast<std::byte>(random.below(256));
  for (const int run : {1, 2}) {
    Job job(folder.path());
    const auto kept = job.results->encodings(0);
    REQUIRE(kept != nullptr);
    Watched watched(*kept);
    const std::uint64_t before = allocated();
    {
      ImageFile file(job.job.context, folder.file("a.png"), spec, &watched);
      for (std::uint32_t y = 0; y < spec.height; ++y)
        file.write_rows(1, rows.data() + rows.size() / spec.height * y);
      file.finish()->commit();
    }
    CHECK(watched.put() == (run == 1 ? 14 : 0));
    CHECK(watched.found() == (run == 1 ? 0 : 14));
    CHECK(watched.most() - before <= ImageFile::memory_bytes("a.png", spec));
  }
}

}  // namespace
