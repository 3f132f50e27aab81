// SPDX-License-Identifier: Apache-2.0
//
// The cache's limit, and tidying: what goes, what stays, and that the limit is never passed, looked
// at from outside after every append.
#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iomanip>

#include "pounce/cache.h"
#include "store/cache/cache_space.h"
#include "store/cache/store_folder.h"
#include "support/bytes.h"
#include "support/child.h"
#include "support/failing_file_system.h"
#include "support/test_data.h"

namespace pounce::store {
namespace {

namespace fs = std::filesystem;
using test::random_bytes;

constexpr auto kKind = PackKind::colour;
constexpr std::uint64_t kKiB = 1 << 10, kMiB = 1 << 20;

/// Room that all below the folder takes, without our own help.
std::uint64_t room_of(const std::string& root) {
  std::uint64_t room = 0;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (entry.is_regular_file()) room += (entry.file_size() + 4095) / 4096 * 4096;
  }
  return room;
}

/// Room that its folders take.
std::uint64_t folders_of(const std::string& root) {
  std::uint64_t room = 0;
  for (const auto& entry : fs::directory_iterator(root + "/v3")) {
    room += entry.is_directory() ? 4096 : 0;
  }
  return room;
}

CacheOptions limited(std::uint64_t bytes) {
  CacheOptions options;
  options.limit_bytes = bytes;
  return options;
}

/// Makes a pack of so many chunks of 64 KiB; `largest` is the most that the cache ever took.
std::unique_ptr<PackReader> make(StoreFolder& store, std::uint64_t key, std::uint32_t chunks,
                                 const std::string& root, std::uint64_t* largest) {
  CHECK_FALSE(store.find(kKind, {0, key}, nullptr));
  auto writer = store.create(kKind, {0, key}, "skin.png");
  for (std::uint32_t i = 0; i < chunks; ++i) {
    writer->append(ChunkKind::block, random_bytes(64 << 10, i), 1 << 20);
    *largest = std::max(*largest, room_of(root));
  }
  writer->finish(writer->append(ChunkKind::directory, {}, 0));
  auto pack = store.publish(std::move(writer));
  *largest = std::max(*largest, room_of(root));
  return pack;
}

bool has(const std::string& root, std::uint64_t key) {
  return fs::exists(CacheLayout(root).pack(kKind, {0, key}));
}

TEST_CASE("what was used longest ago makes room before anything is written", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  const auto store = StoreFolder::open_cache(posix_file_system(), root, limited(4 * kMiB));
  std::uint64_t largest = 0;
  for (std::uint64_t key = 0; key < 3; ++key) make(*store, key, 16, root, &largest);
  store->find(kKind, {0, 0}, nullptr);  // now 1 is the one used longest ago
  CHECK((has(root, 0) && has(root, 1) && has(root, 2)));
  make(*store, 3, 16, root, &largest);
  CHECK((has(root, 0) && !has(root, 1) && has(root, 2) && has(root, 3)));
  for (std::uint64_t key = 4; key < 20; ++key)
    make(*store, key, 5 + static_cast<std::uint32_t>(key % 7), root, &largest);
  CHECK(has(root, 19));
  CHECK(largest <= 4 * kMiB);
  CHECK(largest > 3 * kMiB);  // and it is used
  CHECK(store->take_notes().empty());
  CHECK(posix_file_system().list(root + "/v3/tmp").empty());
}

TEST_CASE("a pack that is open is never removed to make room", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  std::uint64_t largest = 0;
  const auto store = StoreFolder::open_cache(posix_file_system(), root, limited(4 * kMiB));
  test::Child child([&](const auto& ready) {
    const auto theirs = StoreFolder::open_cache(posix_file_system(), root);
    theirs->find(kKind, {0, 0}, nullptr);
    auto writer = theirs->create(kKind, {0, 0});
    writer->append(ChunkKind::block, random_bytes(2 << 20, 1), 4 << 20);
    writer->finish(writer->append(ChunkKind::directory, {}, 0));
    const auto open = theirs->publish(std::move(writer));
    ready();
    for (;;) ::pause();
  });
  REQUIRE(child.ready());
  for (std::uint64_t key = 1; key < 6; ++key) make(*store, key, 12, root, &largest);
  CHECK(has(root, 0));  // used longest ago, and in use
  CHECK(largest <= 4 * kMiB);
  child.kill_now();
  for (std::uint64_t key = 6; key < 9; ++key) make(*store, key, 16, root, &largest);
  CHECK_FALSE(has(root, 0));
  CHECK(largest <= 4 * kMiB);
}

TEST_CASE("what fits only without room ahead is not given up for a pack in use", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  constexpr std::uint64_t kLimit = 4 * kMiB, kStep = 64 * kKiB, kBeside = 24 * kKiB;
  const auto store = StoreFolder::open_cache(posix_file_system(), root);
  std::uint64_t largest = 0;
  const auto in_use = make(*store, 1, 16, root, &largest);
  make(*store, 2, 8, root, &largest);
  const CacheLayout layout(root);
  const std::string part = layout.parts_folder() + "/part";
  const auto file = posix_file_system().create(part);
  CacheSpace space(posix_file_system(), layout, kLimit, nullptr);
  const CacheScan scan = scan_cache(posix_file_system(), layout);
  REQUIRE(scan.objects.size() == 2);
  // Half a step is left when all that is not in use has gone.
  const std::uint64_t size =
      kLimit - kBeside - kStep / 2 - (scan.total_bytes - scan.objects[1].taken_bytes);
  CHECK(space.reserve(part, 0, size) == size);
  CHECK(has(root, 1));
  CHECK_FALSE(has(root, 2));
  CHECK(room_of(root) <= kLimit);
  CHECK(space.reserve(part, size, size + kStep) == 0);
}

TEST_CASE("a pack that does not fit is made in scratch, once said, and found again", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  CacheOptions options = limited(2 * kMiB);
  options.scratch_folder = folder.path().string();
  const auto store = StoreFolder::open_cache(posix_file_system(), root, options);
  std::uint64_t largest = 0;
  const auto kept = make(*store, 0, 12, root, &largest);  // open: it cannot make room
  const auto big = make(*store, 1, 60, root, &largest);
  CHECK(big->verify() == 61);
  make(*store, 2, 40, root, &largest);
  CHECK(largest <= 2 * kMiB);
  CHECK(has(root, 0));
  CHECK_FALSE(has(root, 1));
  const auto again = store->find(kKind, {0, 1}, nullptr);
  REQUIRE(again);
  CHECK(again->verify() == 61);
  const auto notes = store->take_notes();
  REQUIRE(notes.size() == 1);
  CHECK_THAT(notes[0], Catch::Contains("--cache-limit") && Catch::Contains("2.0 MiB"));
  CHECK(posix_file_system().list(root + "/v3/tmp").empty());
  CHECK(posix_file_system().list(root + "/v3/locks").empty());  // others may try
}

TEST_CASE("writers beside each other keep to the limit together", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  const auto first = StoreFolder::open_cache(posix_file_system(), root, limited(3 * kMiB));
  const auto second = StoreFolder::open_cache(posix_file_system(), root, limited(3 * kMiB));
  std::vector<std::unique_ptr<PackWriter>> writers;
  for (std::uint64_t key = 0; key < 6; ++key) {
    StoreFolder& store = key % 2 == 0 ? *first : *second;
    CHECK_FALSE(store.find(kKind, {0, key}, nullptr));
    writers.push_back(store.create(kKind, {0, key}, "beside"));
  }
  std::uint64_t largest = 0;
  for (std::uint32_t i = 0; i < 20; ++i) {
    for (const auto& writer : writers) {
      writer->append(ChunkKind::block, random_bytes(50'000, i), 60'000);
      largest = std::max(largest, room_of(root));
    }
  }
  for (std::size_t i = 0; i < writers.size(); ++i) {
    writers[i]->finish(writers[i]->append(ChunkKind::directory, {}, 0));
    CHECK((i % 2 == 0 ? *first : *second).publish(std::move(writers[i]))->verify() == 21);
    largest = std::max(largest, room_of(root));
  }
  CHECK(largest <= 3 * kMiB);
  CHECK(cache_list(root).size() >= 2);
  CHECK(cache_list(root).size() < 6);
}

TEST_CASE("what is reported is what is there", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  CHECK(cache_list(root).empty());
  CHECK(cache_info(root).taken_bytes == 0);
  CHECK(cache_clear(root).objects == 0);
  CHECK_FALSE(fs::exists(root));  // looking makes nothing
  const auto store = StoreFolder::open_cache(posix_file_system(), root);
  std::uint64_t largest = 0;
  make(*store, 5, 3, root, &largest);
  make(*store, 6, 30, root, &largest);
  const auto list = cache_list(root);
  REQUIRE(list.size() == 2);
  CHECK(list[0].key == to_hex({0, 5}));
  CHECK(list[0].kind == "colour");
  CHECK(list[0].label == "skin.png");
  CHECK(list[0].size_bytes == fs::file_size(list[0].path));
  const CacheInfo info = cache_info(root);
  CHECK(info.taken_bytes == room_of(root) + folders_of(root));
  CHECK(info.kinds.at("colour").objects == 2);
  CHECK(info.kinds.at("colour").bytes == list[0].size_bytes + list[1].size_bytes);
  CHECK(info.default_limit_bytes == posix_file_system().disk_bytes(root) / 10);
  const auto writer = store->create(kKind, {0, 7});
  CHECK(cache_info(root).unfinished.objects == 1);
}

TEST_CASE("verify names every damaged pack and can remove it", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  std::uint64_t largest = 0;
  {
    const auto store = StoreFolder::open_cache(posix_file_system(), root);
    for (std::uint64_t key = 0; key < 3; ++key) make(*store, key, 4, root, &largest);
  }
  CHECK(cache_verify(root).objects == 3);
  CHECK(cache_verify(root).damaged.empty());
  const std::string path = CacheLayout(root).pack(kKind, {0, 1});
  auto bytes = test::read_whole(posix_file_system(), path);
  bytes[bytes.size() / 2] ^= std::byte{8};
  test::write_whole(posix_file_system(), path, bytes);
  const CacheVerdict verdict = cache_verify(root);
  REQUIRE(verdict.damaged.size() == 1);
  CHECK(verdict.damaged[0].object.path == path);
  CHECK_FALSE(verdict.damaged[0].removed);
  CHECK(fs::exists(path));
  CHECK(cache_verify(root, true).damaged.at(0).removed);
  CHECK_FALSE(fs::exists(path));
  CHECK(cache_list(root).size() == 2);
}

TEST_CASE("prune and clear leave what is open, and what living writers write", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  const auto store = StoreFolder::open_cache(posix_file_system(), root);
  std::uint64_t largest = 0;
  auto open = make(*store, 0, 4, root, &largest);
  for (std::uint64_t key = 1; key < 5; ++key) make(*store, key, 4, root, &largest);
  auto writer = store->create(kKind, {1, 1});
  writer->append(ChunkKind::block, random_bytes(1000, 1), 2000);
  // An hour ago: 1 and 2.
  for (const std::uint64_t key : {1, 2}) {
    fs::last_write_time(CacheLayout(root).pack(kKind, {0, key}),
                        fs::file_time_type::clock::now() - std::chrono::hours(1));
  }
  CHECK(cache_prune(root, std::nullopt, std::nullopt).objects == 0);
  CHECK(cache_prune(root, std::nullopt, 1800.0).objects == 2);
  CHECK((!has(root, 1) && !has(root, 2) && has(root, 3) && has(root, 4)));
  const CachePruned pruned = cache_prune(root, room_of(root) - kKiB, std::nullopt);
  CHECK(pruned.objects + pruned.in_use >= 2);  // 0 is older than 3 and in use
  CHECK((has(root, 0) && !has(root, 3)));
  CHECK(cache_clear(root).in_use == 1);
  CHECK((has(root, 0) && !has(root, 4)));
  writer->finish(writer->append(ChunkKind::directory, {}, 0));
  CHECK(store->publish(std::move(writer))->verify() == 2);
  CHECK(open->verify() == 5);
  open.reset();
  const CachePruned cleared = cache_clear(root);
  CHECK(cleared.objects == 2);
  CHECK(cleared.in_use == 0);
  CHECK(cleared.taken_bytes == room_of(root) + folders_of(root));
}

/// A disk with room for so much below `root`.
class SmallDisk final : public test::FailingFileSystem {
 public:
  SmallDisk(std::string root, std::uint64_t bytes)
      : FailingFileSystem(posix_file_system()), root_(std::move(root)), bytes_(bytes) {}
  std::uint64_t free_bytes(const std::string&) override {
    return bytes_ - std::min(bytes_, room_of(root_));
  }

 private:
  const std::string root_;
  const std::uint64_t bytes_;
};

TEST_CASE("a disk that fills up is a lower limit", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  SmallDisk disk(root, 5 * kMiB);
  CacheOptions options = limited(100 * kMiB);
  options.scratch_folder = folder.path().string();
  const auto store = StoreFolder::open_cache(disk, root, options);
  std::uint64_t largest = 0;
  for (std::uint64_t key = 1; key <= 8; ++key) make(*store, key, 10, root, &largest);
  CHECK(largest <= 5 * kMiB);
  CHECK(cache_list(root).size() >= 2);
  CHECK(cache_list(root).back().key == to_hex({0, 8}));  // older ones made room
  CHECK(store->take_notes().empty());
  make(*store, 9, 90, root, &largest);  // larger than the disk: it is made all the same
  CHECK(largest <= 5 * kMiB);
  CHECK(store->take_notes().size() == 1);
}

TEST_CASE("a damaged label says nothing to a terminal", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  const auto store = StoreFolder::open_cache(posix_file_system(), root);
  std::uint64_t largest = 0;
  make(*store, 1, 1, root, &largest);
  const std::string label = CacheLayout(root).label(kKind, {0, 1});
  std::ofstream(label) << "a\x1b[2Jb\x7f\tc\nsecond line";
  CHECK(cache_list(root).at(0).label == "a?[2Jb??c");
  fs::resize_file(label, 0);
  CHECK(cache_list(root).at(0).label.empty());
  fs::resize_file(label, 1 << 20);
  CHECK(cache_list(root).at(0).label == std::string(4096, '?'));
}

TEST_CASE("a label whose pack is gone goes with the next tidying", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  const auto store = StoreFolder::open_cache(posix_file_system(), root);
  std::uint64_t largest = 0;
  make(*store, 0, 1, root, &largest);
  fs::remove(CacheLayout(root).pack(kKind, {0, 0}));
  CHECK(fs::exists(CacheLayout(root).label(kKind, {0, 0})));
  cache_clear(root);
  CHECK_FALSE(fs::exists(CacheLayout(root).label(kKind, {0, 0})));
}

/// Counts the files that are looked at.
class WatchedDisk final : public test::FailingFileSystem {
 public:
  WatchedDisk() : FailingFileSystem(posix_file_system()) {}
  std::optional<FileStatus> status(const std::string& path) override {
    ++looks;
    return FailingFileSystem::status(path);
  }
  std::uint64_t looks = 0;
};

TEST_CASE("a pack more does not cost a look at all that are there", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  WatchedDisk disk;
  const auto store = StoreFolder::open_cache(disk, root, limited(100 * kMiB));
  std::uint64_t largest = 0;
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t key = 0; key < 100; ++key) make(*store, key, 1, root, &largest);
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
  // Some 200 files, each second and at the beginning. Looking each time would be 10,000.
  CHECK(static_cast<double>(disk.looks) < 300 * (passed.count() + 1));
  CHECK(cache_list(root).size() == 100);
}

TEST_CASE("a lock tells whether anybody else has had it", "[format]") {
  FileSystem& files = posix_file_system();
  const test::TempFolder folder;
  const std::string path = folder.file("space.lock");
  CHECK_FALSE(files.try_lock(path)->was_ours());
  CHECK(files.try_lock(path)->was_ours());
  // As a process of the same number writes it, in a container or on another machine.
  std::ofstream(path) << std::left << std::setw(12) << ::getpid() << "\n"
                      << std::string(32, '0') << "\n";
  CHECK_FALSE(files.try_lock(path)->was_ours());
  CHECK(files.try_lock(path)->was_ours());
  test::Child child([&](const auto& ready) {
    files.try_lock(path).reset();
    ready();
    for (;;) ::pause();
  });
  REQUIRE(child.ready());
  CHECK_FALSE(files.try_lock(path)->was_ours());
}

TEST_CASE("whoever may lock must be able to say so", "[format]") {
  FileSystem& files = posix_file_system();
  const test::TempFolder folder;
  const std::string parts = folder.file("tmp"), lock = folder.file("space.lock");
  fs::create_directory(parts);
  std::ofstream(lock) << "1";
  const auto lets = [&](unsigned parts_mode, unsigned lock_mode) {
    fs::permissions(parts, static_cast<fs::perms>(parts_mode));
    fs::permissions(lock, static_cast<fs::perms>(lock_mode));
    return files.lets_all_write(lock, parts);
  };
  CHECK(lets(0755, 0644));
  CHECK(lets(0775, 0664));
  CHECK(lets(0777, 0666));
  CHECK_FALSE(lets(0777, 0644));  // the second user's lock is only opened for reading
  CHECK_FALSE(lets(0775, 0644));
  CHECK_FALSE(lets(0777, 0664));
  CHECK_FALSE(files.lets_all_write(folder.file("none"), parts));
}

TEST_CASE("what others add is seen although nobody looks", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  std::uint64_t largest = 0;
  const auto ours = StoreFolder::open_cache(posix_file_system(), root, limited(4 * kMiB));
  make(*ours, 0, 1, root, &largest);
  SECTION("in this process") {
    const auto theirs = StoreFolder::open_cache(posix_file_system(), root, limited(4 * kMiB));
    make(*theirs, 1, 55, root, &largest);
    make(*ours, 2, 20, root, &largest);
  }
  SECTION("in another") {
    test::Child child([&](const auto& ready) {
      std::uint64_t most = 0;
      const auto theirs = StoreFolder::open_cache(posix_file_system(), root, limited(4 * kMiB));
      make(*theirs, 1, 55, root, &most);
      ready();
      for (;;) ::pause();
    });
    REQUIRE(child.ready());
    make(*ours, 2, 20, root, &largest);
  }
  CHECK(has(root, 2));
  CHECK_FALSE(has(root, 1));  // it had to go
  CHECK(largest <= 4 * kMiB);
}

}  // namespace
}  // namespace pounce::store
