// SPDX-License-Identifier: Apache-2.0
#include "store/cache/store_folder.h"

#include <catch2/catch.hpp>
#include <filesystem>

#include "support/bytes.h"
#include "support/failing_file_system.h"
#include "support/memory_file_system.h"
#include "support/test_data.h"

namespace pounce::store {
namespace {

using test::error_kind;
using test::FailingFileSystem;
using test::kDamaged;
using test::kStorage;
using test::random_bytes;

constexpr Hash128 kKey{0xabc, 0xdef};

/// Builds a pack of a few chunks (one larger than any write buffer) and publishes it.
std::unique_ptr<PackReader> build(StoreFolder& store, const Hash128& key = kKey,
                                  PackKind kind = PackKind::geometry) {
  auto writer = store.create(kind, key);
  writer->append(ChunkKind::block, random_bytes(500, 1), 1000);
  writer->append(ChunkKind::block, random_bytes(300'000, 2), 600'000);
  writer->finish(writer->append(ChunkKind::directory, random_bytes(100, 3), 200));
  return store.publish(std::move(writer));
}

std::string pack_path(const std::string& root) {
  return root + "/v3/geometry/" + to_hex(kKey) + ".pack";
}

TEST_CASE("a published pack is found by this run and the next, under its own key", "[format]") {
  const test::TempFolder folder;
  const auto memory = test::make_memory_file_system();
  FileSystem& files = GENERATE(true, false) ? posix_file_system() : *memory;
  const std::string root = folder.file("cache");
  std::string warning;
  for (int run = 0; run < 2; ++run) {
    const auto store = StoreFolder::open_cache(files, root);
    REQUIRE(store);
    CHECK(store->persistent());
    if (run == 0) {
      CHECK_FALSE(store->find(PackKind::geometry, kKey, &warning));
      CHECK(build(*store)->verify() == 3);
    }
    const auto found = store->find(PackKind::geometry, kKey, &warning);
    REQUIRE(found);
    CHECK(found->verify() == 3);
    CHECK(found->name() == pack_path(root));
    CHECK_FALSE(store->find(PackKind::colour, kKey, &warning));
    CHECK_FALSE(store->find(PackKind::geometry, {1, 2}, &warning));
    CHECK(files.list(root + "/v3/tmp").empty());
  }
  CHECK(warning.empty());
  CHECK(files.list(root + "/v3/geometry") == std::vector<std::string>{to_hex(kKey) + ".pack"});
}

TEST_CASE("a discarded pack is gone, but not for those who read it", "[format]") {
  const test::TempFolder folder;
  const auto store = GENERATE(true, false)
                         ? StoreFolder::open_cache(posix_file_system(), folder.file("cache"))
                         : StoreFolder::make_scratch(posix_file_system(), folder.path().string());
  const auto reader = build(*store);
  store->discard(PackKind::geometry, kKey);
  store->discard(PackKind::geometry, kKey);
  CHECK_FALSE(store->find(PackKind::geometry, kKey, nullptr));
  CHECK(reader->verify() == 3);
}

TEST_CASE("a scratch store leaves no name and finds what this run published", "[format]") {
  const test::TempFolder folder;
  const auto store = StoreFolder::make_scratch(posix_file_system(), folder.path().string());
  CHECK_FALSE(store->persistent());
  CHECK_FALSE(store->find(PackKind::geometry, kKey, nullptr));
  CHECK(build(*store)->verify() == 3);
  build(*store, kKey, PackKind::colour);
  const auto found = store->find(PackKind::geometry, kKey, nullptr);
  REQUIRE(found);
  CHECK(found->verify() == 3);
  CHECK_FALSE(store->find(PackKind::geometry, {1, 2}, nullptr));
  CHECK(std::filesystem::is_empty(folder.path()));
}

TEST_CASE("a pack of a scratch store can be read after the store is gone", "[format]") {
  const test::TempFolder folder;
  auto store = StoreFolder::make_scratch(posix_file_system(), folder.path().string());
  const auto reader = build(*store);
  store.reset();
  CHECK(reader->verify() == 3);
}

TEST_CASE("a damaged pack is removed with a warning and treated as absent", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  FileSystem& files = posix_file_system();
  const auto store = StoreFolder::open_cache(files, root);
  build(*store);
  auto bytes = test::read_whole(files, pack_path(root));
  // In the header, in the directory chunk, in the footer, an end cut off, nothing left at all.
  const std::size_t size = bytes.size();
  for (const std::size_t at : {std::size_t{20}, size - 100, size - 10, size, std::size_t{0}}) {
    auto bad = bytes;
    if (at == size) {
      bad.resize(size - 1);
    } else if (at == 0) {
      bad.clear();
    } else {
      bad[at] ^= std::byte{4};
    }
    test::write_whole(files, pack_path(root), bad);
    std::string warning = "earlier";
    CAPTURE(at);
    CHECK_FALSE(store->find(PackKind::geometry, kKey, &warning));
    CHECK_THAT(warning, Catch::StartsWith("earlier\n") && Catch::Contains(pack_path(root)));
    CHECK_FALSE(files.exists(pack_path(root)));
  }
  // Damage in a block shows when the block is read.
  bytes[80] ^= std::byte{1};
  test::write_whole(files, pack_path(root), bytes);
  const auto found = store->find(PackKind::geometry, kKey, nullptr);
  REQUIRE(found);
  CHECK(error_kind([&] { found->verify(); }) == kDamaged);
}

TEST_CASE("a pack copied under another key is not taken for it", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  const auto store = StoreFolder::open_cache(posix_file_system(), root);
  build(*store);
  const Hash128 other{0xabc, 0xdee};
  std::filesystem::copy_file(pack_path(root), root + "/v3/geometry/" + to_hex(other) + ".pack");
  std::string warning;
  CHECK_FALSE(store->find(PackKind::geometry, other, &warning));
  CHECK_THAT(warning, Catch::Contains(to_hex(other)));
}

TEST_CASE("an abandoned writer leaves nothing behind", "[format]") {
  const test::TempFolder folder;
  const std::string root = folder.file("cache");
  const auto store = StoreFolder::open_cache(posix_file_system(), root);
  {
    const auto writer = store->create(PackKind::results, kKey);
    writer->append(ChunkKind::block, random_bytes(300'000, 1), 300'000);
    CHECK(posix_file_system().list(root + "/v3/tmp").size() == 1);
  }
  CHECK(posix_file_system().list(root + "/v3/tmp").empty());
  auto unfinished = store->create(PackKind::results, kKey);
  CHECK(error_kind([&] { store->publish(std::move(unfinished)); }) ==
        static_cast<int>(ErrorKind::internal));
  CHECK_FALSE(store->find(PackKind::results, kKey, nullptr));
}

TEST_CASE("a folder that cannot be made is a storage error", "[format]") {
  const test::TempFolder folder;
  test::write_whole(posix_file_system(), folder.file("file"), random_bytes(1, 1));
  std::string message;
  CHECK(error_kind([&] { StoreFolder::open_cache(posix_file_system(), folder.file("file/cache")); },
                   &message) == kStorage);
  CHECK_THAT(message, Catch::Contains("file/cache"));
  const auto scratch = StoreFolder::make_scratch(posix_file_system(), folder.file("missing"));
  CHECK(error_kind([&] { scratch->create(PackKind::geometry, kKey); }, &message) == kStorage);
  CHECK_THAT(message, Catch::Contains("missing"));
}

/// One run: opens the cache, builds, publishes. True if it got to the end.
bool run_once(FileSystem& files, const std::string& root) {
  return error_kind([&] {
           const auto store = StoreFolder::open_cache(files, root);
           REQUIRE(store);
           if (!store->find(PackKind::geometry, kKey, nullptr)) build(*store)->verify();
         }) == 0;
}

TEST_CASE("whichever file call fails, the store holds a whole pack or none", "[format]") {
  const bool on_disk = GENERATE(true, false);
  const bool from_then_on = GENERATE(true, false);
  const bool short_writes = GENERATE(true, false);
  CAPTURE(on_disk, from_then_on, short_writes);
  std::uint64_t calls = 0;
  std::uint64_t failures = 0;
  for (std::uint64_t n = 0; n <= calls; ++n) {
    const test::TempFolder folder;
    const auto memory = test::make_memory_file_system();
    FileSystem& real = on_disk ? posix_file_system() : *memory;
    const std::string root = folder.file("cache");
    FailingFileSystem files(real, {n, from_then_on, short_writes});
    const bool done = run_once(files, root);
    if (n == 0) {
      REQUIRE(done);
      calls = files.calls();
      continue;
    }
    CAPTURE(n);
    failures += !done;
    // The next run, on a disk that works.
    const auto store = StoreFolder::open_cache(real, root);
    REQUIRE(store);
    CHECK(real.list(root + "/v3/tmp").empty());
    std::string warning;
    if (const auto found = store->find(PackKind::geometry, kKey, &warning))
      CHECK(found->verify() == 3);
    CHECK(warning.empty());
    CHECK(run_once(real, folder.file("other")));
    if (!store->find(PackKind::geometry, kKey, nullptr)) build(*store);
    CHECK(store->find(PackKind::geometry, kKey, nullptr)->verify() == 3);
  }
  CHECK(calls > 20);
  // No failure is swallowed but that of removing the key's lock file.
  CHECK(failures == calls - (from_then_on ? 0 : 1));
}

TEST_CASE("a scratch store reports every failing file call", "[format]") {
  const test::TempFolder folder;
  FailingFileSystem files(posix_file_system());
  const auto run = [&] {
    return error_kind([&] {
      const auto store = StoreFolder::make_scratch(files, folder.path().string());
      build(*store)->verify();
    });
  };
  REQUIRE(run() == 0);
  const std::uint64_t calls = files.calls();
  REQUIRE(calls > 8);
  for (std::uint64_t n = 1; n <= calls; ++n) {
    files.restart({n, false, true});
    CAPTURE(n);
    CHECK(run() == kStorage);
    CHECK(std::filesystem::is_empty(folder.path()));
  }
}

/// Counts nameless files.
class ScratchCounting final : public FailingFileSystem {
 public:
  ScratchCounting() : FailingFileSystem(posix_file_system()) {}
  std::unique_ptr<WriteFile> create_scratch(const std::string& folder) override {
    ++made;
    return FailingFileSystem::create_scratch(folder);
  }
  int made = 0;
};

TEST_CASE("small scratch packs of images lie in one file", "[format]") {
  ScratchCounting files;
  const test::TempFolder folder;
  const auto store = StoreFolder::make_scratch(files, folder.path().string());
  std::vector<std::unique_ptr<PackReader>> packs;
  const auto make = [&](std::uint64_t key, std::size_t bytes) {
    auto writer = store->create(PackKind::colour, {0, key});
    const auto seed = static_cast<std::uint32_t>(key);
    const ChunkRef block = writer->append(ChunkKind::block, random_bytes(bytes, seed), 100'000);
    writer->finish(writer->append(ChunkKind::directory, random_bytes(20, seed), 20));
    packs.push_back(store->publish(std::move(writer)));
    return block;
  };
  const auto is_whole = [](const PackReader& pack, const ChunkRef& block, std::size_t bytes,
                           std::uint32_t seed) {
    return pack.verify() == 2 && test::bytes_of(pack.read(block, ChunkKind::block).payload()) ==
                                     random_bytes(bytes, seed);
  };
  std::vector<ChunkRef> blocks;
  // Those of 70,000 bytes are too large for it.
  for (std::uint64_t key = 0; key < 40; ++key)
    blocks.push_back(make(key, key % 10 == 9 ? 70'000 : 100 + 300 * key));
  for (std::uint64_t key = 0; key < 40; ++key) {
    const std::size_t bytes = key % 10 == 9 ? 70'000 : 100 + 300 * key;
    const auto seed = static_cast<std::uint32_t>(key);
    CHECK(is_whole(*packs[key], blocks[key], bytes, seed));
    const auto again = store->find(PackKind::colour, {0, key}, nullptr);
    REQUIRE(again);
    CHECK(is_whole(*again, blocks[key], bytes, seed));
  }
  CHECK(files.made == 5);  // one, and four of their own
}

}  // namespace
}  // namespace pounce::store
