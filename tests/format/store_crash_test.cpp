// SPDX-License-Identifier: Apache-2.0
//
// Two processes and one folder. Children only make files and end with _exit or by a signal, so that
// no test runs twice.
#include <unistd.h>

#include <catch2/catch.hpp>

#include "store/cache/store_folder.h"
#include "support/bytes.h"
#include "support/child.h"
#include "support/test_data.h"

namespace pounce::store {
namespace {

using test::Child;

constexpr Hash128 kKey{7, 8};

TEST_CASE("a process killed while it writes leaves nothing that is seen or stays", "[format]") {
  const test::TempFolder folder;
  FileSystem& files = posix_file_system();
  const std::string tmp = folder.file("cache") + "/v3/tmp";
  Child child([&](const auto& ready) {
    const auto store = StoreFolder::open_cache(files, folder.file("cache"));
    const auto writer = store->create(PackKind::geometry, kKey);
    for (std::uint32_t i = 0; i < 10; ++i) {
      writer->append(ChunkKind::block, test::random_bytes(100'000, i), 100'000);
    }
    writer->finish(writer->append(ChunkKind::directory, {}, 0));
    writer->file().sync();
    ready();  // whole and on the disk, but not under its name yet
    for (;;) ::pause();
  });
  REQUIRE(child.ready());
  child.kill_now();
  REQUIRE(files.list(tmp).size() == 1);
  const auto store = StoreFolder::open_cache(files, folder.file("cache"));
  REQUIRE(store);
  CHECK(files.list(tmp).empty());
  std::string warning;
  CHECK_FALSE(store->find(PackKind::geometry, kKey, &warning));
  CHECK(warning.empty());
}

TEST_CASE("at whatever moment a process is killed, packs are whole or absent", "[format]") {
  FileSystem& files = posix_file_system();
  for (unsigned moment = 0; moment < 60; ++moment) {
    const test::TempFolder folder;
    {
      const Child child([&](const auto& ready) {
        const auto store = StoreFolder::open_cache(files, folder.file("cache"));
        for (std::uint64_t key = 0; key < 1000; ++key) {
          if (key == moment % 3) ready();  // so many packs are there whatever the machine's speed
          auto writer = store->create(PackKind::results, {0, key});
          for (std::uint32_t i = 0; i < 3; ++i) {
            writer->append(ChunkKind::block, test::random_bytes(20'000, i), 20'000);
          }
          writer->finish(writer->append(ChunkKind::directory, {}, 0));
          store->publish(std::move(writer));
        }
      });
      REQUIRE(child.ready());
      ::usleep(moment * 211);  // spread over some ten publications
    }
    const auto store = StoreFolder::open_cache(files, folder.file("cache"));
    REQUIRE(store);
    CHECK(files.list(folder.file("cache") + "/v3/tmp").empty());
    const auto names = files.list(folder.file("cache") + "/v3/results");
    CHECK(names.size() >= moment % 3);
    std::string warning;
    for (std::uint64_t key = 0; key < names.size(); ++key) {
      const auto found = store->find(PackKind::results, {0, key}, &warning);
      REQUIRE(found);
      CHECK(found->verify() == 4);
    }
    CHECK(warning.empty());
  }
}

}  // namespace
}  // namespace pounce::store
