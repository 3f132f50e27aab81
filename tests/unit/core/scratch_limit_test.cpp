// SPDX-License-Identifier: Apache-2.0
//
// What scratch files may take together: exact to the byte, free again once nobody has a file open.
#include "core/scratch_limit.h"

#include <catch2/catch.hpp>
#include <vector>

#include "pounce/error.h"

using namespace pounce;

namespace {

void append(WriteFile& file, std::size_t bytes) {
  const std::vector<std::byte> some(bytes, std::byte{7});
  file.append(some);
}

}  // namespace

TEST_CASE("scratch files keep to their limit together") {
  const auto memory = make_memory_file_system();
  const auto account =
      std::make_shared<ScratchAccount>(100, [] { return std::string("too much"); });
  const auto files = count_scratch(*memory, account);
  const ScratchFolder folder{files.get(), "/"};
  auto first = folder.create();
  const auto second = folder.create();
  append(*first, 60);
  append(*second, 40);
  REQUIRE_THROWS_WITH(append(*second, 1), "too much");
  CHECK(second->size_bytes() == 40);  // nothing of it
  append(*second, 0);

  auto reader = first->reader();
  first.reset();
  REQUIRE_THROWS_AS(append(*second, 1), Error);  // its reader still has it
  std::vector<std::byte> read(60);
  reader->read(0, read);
  CHECK(read.back() == std::byte{7});
  reader.reset();
  CHECK(account->peak_bytes() == 100);
  append(*second, 60);
  REQUIRE_THROWS_AS(append(*second, 1), Error);
}

TEST_CASE("what scratch files took at most is known without a limit") {
  const auto memory = make_memory_file_system();
  const auto account = std::make_shared<ScratchAccount>(0, [] { return std::string("no limit"); });
  const auto files = count_scratch(*memory, account);
  const ScratchFolder folder{files.get(), "/"};
  CHECK(account->peak_bytes() == 0);
  auto first = folder.create();
  append(*first, 60);
  first.reset();
  const auto second = folder.create();
  append(*second, 50);
  CHECK(account->peak_bytes() == 60);
  append(*second, 50);
  CHECK(account->peak_bytes() == 100);
}

TEST_CASE("files with names have no limit") {
  const auto memory = make_memory_file_system();
  const auto files = count_scratch(
      *memory, std::make_shared<ScratchAccount>(10, [] { return std::string("too much"); }));
  append(*files->create("/named"), 1000);
  CHECK(memory->open("/named")->size_bytes() == 1000);
}

TEST_CASE("the limit is a tenth of what is free, a GiB at least") {
  constexpr std::uint64_t kGiB = 1ULL << 30;
  FileSystem& disk = posix_file_system();
  const std::uint64_t free = disk.free_bytes("/");
  const std::uint64_t limit = default_scratch_limit(disk, "/");
  CHECK(limit >= kGiB);
  if (free / 12 > kGiB) CHECK((limit > free / 12 && limit < free / 8));
  CHECK_THROWS_AS(default_scratch_limit(disk, "/no such folder"), Error);
}
