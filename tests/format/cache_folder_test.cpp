// SPDX-License-Identifier: Apache-2.0
//
// One cache, several processes: who makes a pack, who waits, who takes over, what nobody removes.
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <thread>

#include "store/cache/cache_space.h"
#include "store/cache/store_folder.h"
#include "support/bytes.h"
#include "support/child.h"
#include "support/failing_file_system.h"
#include "support/memory_file_system.h"
#include "support/test_data.h"

namespace pounce::store {
namespace {

using test::Child;
using test::error_kind;
using test::random_bytes;

constexpr Hash128 kKey{7, 8}, kOther{9, 10};
constexpr auto kKind = PackKind::geometry;

std::unique_ptr<PackWriter> write(StoreFolder& store, const Hash128& key, std::uint32_t seed = 1) {
  auto writer = store.create(kKind, key, "a test");
  writer->append(ChunkKind::block, random_bytes(50'000, seed), 100'000);
  writer->finish(writer->append(ChunkKind::directory, random_bytes(100, 3), 200));
  return writer;
}

struct Waits {
  int calls = 0;
  std::string holder;
  CacheOptions options() {
    CacheOptions options;
    options.waiting = [this](const std::string& who, const std::string&) {
      ++calls;
      holder = who;
    };
    return options;
  }
};

TEST_CASE("who finds a pack in the making waits for it and then has it", "[format]") {
  const test::TempFolder folder;
  FileSystem& files = posix_file_system();
  const std::string root = folder.file("cache");
  Child child([&](const auto& ready) {
    const auto store = StoreFolder::open_cache(files, root);
    if (store->find(kKind, kKey, nullptr)) ::_exit(8);
    auto writer = write(*store, kKey);
    ready();
    ::usleep(200'000);
    store->publish(std::move(writer));
  });
  REQUIRE(child.ready());
  Waits waits;
  const auto store = StoreFolder::open_cache(files, root, waits.options());
  const auto pack = store->find(kKind, kKey, nullptr);
  REQUIRE(pack);
  CHECK(pack->verify() == 2);
  CHECK(waits.calls >= 2);
  CHECK(waits.holder == "process " + std::to_string(child.pid()));
}

TEST_CASE("when the maker of a pack dies, a waiter takes over", "[format]") {
  const test::TempFolder folder;
  FileSystem& files = posix_file_system();
  const std::string root = folder.file("cache");
  Child child([&](const auto& ready) {
    const auto store = StoreFolder::open_cache(files, root);
    store->find(kKind, kKey, nullptr);
    const auto writer = write(*store, kKey);
    ready();
    for (;;) ::pause();
  });
  REQUIRE(child.ready());
  CacheOptions options;
  int calls = 0;
  options.waiting = [&](const std::string&, const std::string&) {
    if (++calls == 3) child.kill_now();
  };
  const auto store = StoreFolder::open_cache(files, root, options);
  // What the living one writes is no leftover.
  CHECK(files.list(root + "/v3/tmp").size() == 1);
  CHECK_FALSE(store->find(kKind, kKey, nullptr));
  CHECK(calls == 3);
  CHECK(store->publish(write(*store, kKey))->verify() == 2);
  // What the dead one wrote is one, for the next who comes.
  CHECK(files.list(root + "/v3/tmp").size() == 1);
  StoreFolder::open_cache(files, root);
  CHECK(files.list(root + "/v3/tmp").empty());
  CHECK(files.list(root + "/v3/locks").empty());
}

TEST_CASE("waiting ends with what its callback throws, and then holds nothing", "[format]") {
  const test::TempFolder folder;
  FileSystem& files = posix_file_system();
  const std::string root = folder.file("cache");
  const auto maker = StoreFolder::open_cache(files, root);
  CHECK_FALSE(maker->find(kKind, kKey, nullptr));
  CacheOptions options;
  options.waiting = [](const std::string&, const std::string& path) {
    throw Error(ErrorKind::busy, path);
  };
  const auto store = StoreFolder::open_cache(files, root, options);
  std::string message;
  CHECK(error_kind([&] { store->find(kKind, kKey, nullptr); }, &message) ==
        static_cast<int>(ErrorKind::busy));
  CHECK(message == root + "/v3/geometry/" + to_hex(kKey) + ".pack");
  CHECK(maker->publish(write(*maker, kKey))->verify() == 2);
  CHECK(store->find(kKind, kKey, nullptr));
}

TEST_CASE("nobody waits for a key that was given up", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  const auto first = StoreFolder::open_cache(posix_file_system(), root);
  CHECK_FALSE(first->find(kKind, kKey, nullptr));
  first->give_up(kKind, kKey);
  first->give_up(kKind, kOther);  // that it never had
  Waits waits;
  const auto second = StoreFolder::open_cache(posix_file_system(), root, waits.options());
  CHECK_FALSE(second->find(kKind, kKey, nullptr));
  CHECK(waits.calls == 0);
  CHECK(second->publish(write(*second, kKey))->verify() == 2);
  CHECK(first->find(kKind, kKey, nullptr));
}

TEST_CASE("nobody waits for a key while holding one, so two stores never wait for each other",
          "[format]") {
  const test::TempFolder folder;
  FileSystem& files = posix_file_system();
  const std::string root = folder.file("cache");
  const auto first = StoreFolder::open_cache(files, root);
  const auto second = StoreFolder::open_cache(files, root);
  CHECK_FALSE(first->find(kKind, kKey, nullptr));
  CHECK_FALSE(second->find(kKind, kOther, nullptr));
  // Each asks for what the other makes: both go on.
  CHECK_FALSE(first->find(kKind, kOther, nullptr));
  CHECK_FALSE(second->find(kKind, kKey, nullptr));
  auto early = first->publish(write(*first, kKey));
  // The same pack, made twice: the first one stays, both can be read.
  const auto status = files.status(early->name());
  const auto late = second->publish(write(*second, kKey));
  CHECK(late->verify() == 2);
  CHECK(files.status(late->name())->inode == status->inode);
  CHECK(files.list(root + "/v3/tmp").empty());
}

TEST_CASE("eight threads that want one cold key make it once", "[format]") {
  const test::TempFolder folder;
  const auto memory = test::make_memory_file_system();
  FileSystem& files = GENERATE(true, false) ? posix_file_system() : *memory;
  const std::string root = folder.file("cache");
  std::atomic<int> made{0}, sound{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      const auto store = StoreFolder::open_cache(files, root);
      for (std::uint64_t key = 0; key < 5; ++key) {
        auto pack = store->find(kKind, {0, key}, nullptr);
        if (!pack) {
          ++made;
          pack = store->publish(write(*store, {0, key}));
        }
        if (pack->verify() == 2) ++sound;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(made == 5);
  CHECK(sound == 40);
}

TEST_CASE("a writer that is given up lets the next one make the pack", "[format]") {
  const test::TempFolder folder;
  FileSystem& files = posix_file_system();
  Waits waits;
  const auto store = StoreFolder::open_cache(files, folder.file("cache"));
  const auto other = StoreFolder::open_cache(files, folder.file("cache"), waits.options());
  CHECK_FALSE(store->find(kKind, kKey, nullptr));
  write(*store, kKey).reset();
  CHECK_FALSE(other->find(kKind, kKey, nullptr));
  CHECK(waits.calls == 0);
}

TEST_CASE("a damaged pack is replaced while another process goes on reading it", "[format]") {
  const test::TempFolder folder;
  FileSystem& files = posix_file_system();
  const std::string root = folder.file("cache");
  const auto reading = StoreFolder::open_cache(files, root);
  reading->find(kKind, kKey, nullptr);
  const auto pack = reading->publish(write(*reading, kKey));
  auto bytes = test::read_whole(files, pack->name());
  bytes[100] ^= std::byte{1};  // in the block: seen only by who reads it all
  test::write_whole(files, pack->name(), bytes);
  std::string warning;
  CHECK(StoreFolder::open_cache(files, root)->find(kKind, kKey, &warning));
  CHECK(warning.empty());
  CacheOptions options;
  options.verify = true;
  const auto checking = StoreFolder::open_cache(files, root, options);
  CHECK_FALSE(checking->find(kKind, kKey, &warning));
  CHECK_THAT(warning, Catch::Contains(pack->name()) && Catch::Contains("rebuilding it"));
  CHECK(checking->publish(write(*checking, kKey))->verify() == 2);
  CHECK(checking->find(kKind, kKey, nullptr));
  CHECK(pack->verify() == 2);  // the inode it opened, before the damage
}

TEST_CASE("a cache that cannot be written is read", "[format]") {
  // Root may write anywhere: what a read-only file system says is said here instead.
  class ReadOnly final : public test::FailingFileSystem {
   public:
    using FailingFileSystem::FailingFileSystem;
    bool is_writable(const std::string&) override { return false; }
  };
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  {
    const auto store = StoreFolder::open_cache(posix_file_system(), root);
    store->find(kKind, kKey, nullptr);
    store->publish(write(*store, kKey));
  }
  const auto before = posix_file_system().status(root + "/v3/geometry/" + to_hex(kKey) + ".pack");
  ReadOnly files(posix_file_system());
  CacheOptions options;
  options.scratch_folder = folder.path().string();
  const auto store = StoreFolder::open_cache(files, root, options);
  CHECK(store->find(kKind, kKey, nullptr));
  CHECK_FALSE(store->find(kKind, kOther, nullptr));
  CHECK(store->publish(write(*store, kOther))->verify() == 2);
  CHECK(store->find(kKind, kOther, nullptr));
  CHECK(posix_file_system().list(root + "/v3/geometry").size() == 2);  // the pack and its label
  CHECK(posix_file_system().list(root + "/v3/locks").empty());
  CHECK(posix_file_system().status(root + "/v3/geometry/" + to_hex(kKey) + ".pack")->modified_ns ==
        before->modified_ns);
  const auto notes = store->take_notes();
  REQUIRE(notes.size() == 1);
  CHECK_THAT(notes[0], Catch::Contains(root));
  CHECK(store->take_notes().empty());
}

}  // namespace
}  // namespace pounce::store
