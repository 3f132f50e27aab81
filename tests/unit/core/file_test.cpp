// SPDX-License-Identifier: Apache-2.0
//
// Both file systems must behave alike: every case runs on the disk and in memory.
#include "core/file.h"

#include <sys/resource.h>
#include <sys/stat.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <thread>

#include "support/bytes.h"
#include "support/memory_file_system.h"
#include "support/test_data.h"

namespace pounce {
namespace {

using test::error_kind;
using test::kStorage;
using test::random_bytes;

/// One of the two file systems with a folder to work in.
struct Place {
  explicit Place(bool on_disk) : memory(on_disk ? nullptr : test::make_memory_file_system()) {
    files().make_folders(root());
  }
  FileSystem& files() { return memory ? *memory : posix_file_system(); }
  std::string root() const { return folder.path().string(); }
  std::string operator/(const std::string& name) const { return folder.file(name); }

  test::TempFolder folder;
  std::unique_ptr<FileSystem> memory;
};

TEST_CASE("what was appended in pieces is read back at any offset", "[core]") {
  Place place(GENERATE(true, false));
  const auto bytes = random_bytes(1'000'003, 1);
  const auto file = place.files().create(place / "a");
  // Pieces below, at and above the write buffer's size.
  std::size_t at = 0;
  for (std::size_t piece = 1; at < bytes.size(); piece = piece * 5 + 3) {
    const auto part = std::span(bytes).subspan(at, std::min(piece, bytes.size() - at));
    file->append(part);
    at += part.size();
    REQUIRE(file->size_bytes() == at);
  }
  file->sync();
  CHECK(test::read_whole(place.files(), place / "a") == bytes);
  std::vector<std::byte> middle(70'000);
  place.files().open(place / "a")->read(65'000, middle);
  CHECK(std::equal(middle.begin(), middle.end(), bytes.begin() + 65'000));
}

TEST_CASE("a reader of a growing file sees all that was appended", "[core]") {
  Place place(GENERATE(true, false));
  const auto bytes = random_bytes(600'000, 2);
  const auto file = place.files().create_scratch(place.root());
  const auto reader = file->reader();
  CHECK(reader->size_bytes() == 0);
  for (std::size_t at = 0; at < bytes.size(); at += 1000) {
    file->append(std::span(bytes).subspan(at, 1000));
    std::vector<std::byte> back(1000);
    reader->read(at, back);
    REQUIRE(std::equal(back.begin(), back.end(), bytes.begin() + static_cast<long>(at)));
  }
  CHECK(reader->size_bytes() == bytes.size());
}

TEST_CASE("a scratch file's reader outlives its writer", "[core]") {
  Place place(GENERATE(true, false));
  const auto bytes = random_bytes(5000, 3);
  auto file = place.files().create_scratch(place.root());
  const auto reader = file->reader();
  file->append(bytes);
  file.reset();
  std::vector<std::byte> back(bytes.size());
  reader->read(0, back);
  CHECK(back == bytes);
}

TEST_CASE("one thread appends while others read finished parts", "[core]") {
  Place place(GENERATE(true, false));
  const auto bytes = random_bytes(4'000'000, 4);
  const auto file = place.files().create_scratch(place.root());
  std::atomic<std::size_t> finished{0};
  std::atomic<int> wrong{0};
  const auto check = [&](unsigned seed) {
    const auto reader = file->reader();
    std::mt19937 random(seed);
    std::vector<std::byte> back;
    for (std::size_t end = 0; end < bytes.size();) {
      end = finished.load(std::memory_order_acquire);
      if (end == 0) continue;
      // Half of the reads take the newest bytes, which may still be in the buffer.
      const std::size_t size = std::min<std::size_t>(end, 1 + random() % 3000);
      const std::size_t at = random() % 2 == 0 ? end - size : random() % (end - size + 1);
      back.resize(size);
      reader->read(at, back);
      if (!std::equal(back.begin(), back.end(), bytes.begin() + static_cast<long>(at))) ++wrong;
    }
  };
  std::thread first(check, 1), second(check, 2);
  for (std::size_t at = 0; at < bytes.size(); at += 800) {
    file->append(std::span(bytes).subspan(at, 800));
    finished.store(at + 800, std::memory_order_release);
  }
  first.join();
  second.join();
  CHECK(wrong == 0);
}

TEST_CASE("reading past the end is a storage error that names the file", "[core]") {
  Place place(GENERATE(true, false));
  test::write_whole(place.files(), place / "short", random_bytes(100, 5));
  const auto file = place.files().open(place / "short");
  std::vector<std::byte> out(11);
  std::string message;
  CHECK(error_kind([&] { file->read(90, out); }, &message) == kStorage);
  CHECK_THAT(message, Catch::Contains("short"));
  CHECK(error_kind([&] { file->read(1'000'000, out); }) == kStorage);
}

TEST_CASE("missing files and folders are storage errors with path and reason", "[core]") {
  Place place(GENERATE(true, false));
  std::string message;
  CHECK(error_kind([&] { place.files().open(place / "none"); }, &message) == kStorage);
  CHECK_THAT(message, Catch::Contains("none") && Catch::Contains("No such file"));
  CHECK(error_kind([&] { place.files().create(place / "no/file"); }, &message) == kStorage);
  CHECK_THAT(message, Catch::Contains("no/file"));
  CHECK(error_kind([&] { place.files().list(place / "no"); }) == kStorage);
  CHECK(error_kind([&] { place.files().sync_folder(place / "no"); }) == kStorage);
  CHECK(error_kind([&] { place.files().rename(place / "no", place / "yes"); }) == kStorage);
  CHECK(error_kind([&] { place.files().remove(place / "no"); }) == 0);
}

TEST_CASE("create never touches a file that is there", "[core]") {
  Place place(GENERATE(true, false));
  const auto bytes = random_bytes(10, 6);
  test::write_whole(place.files(), place / "kept", bytes);
  CHECK(error_kind([&] { place.files().create(place / "kept"); }) == kStorage);
  CHECK(test::read_whole(place.files(), place / "kept") == bytes);
}

TEST_CASE("rename replaces, remove removes, list is sorted", "[core]") {
  Place place(GENERATE(true, false));
  FileSystem& files = place.files();
  const auto old_bytes = random_bytes(10, 7), new_bytes = random_bytes(20, 8);
  test::write_whole(files, place / "b", old_bytes);
  const auto still_open = files.open(place / "b");
  test::write_whole(files, place / "c", new_bytes);
  files.rename(place / "c", place / "b");
  CHECK(test::read_whole(files, place / "b") == new_bytes);
  CHECK_FALSE(files.exists(place / "c"));
  std::vector<std::byte> back(10);
  still_open->read(0, back);
  CHECK(back == old_bytes);

  files.make_folders(place / "a/deep/folder");
  files.make_folders(place / "a/deep/folder");
  CHECK(files.exists(place / "a/deep"));
  CHECK(files.list(place.root()) == std::vector<std::string>{"a", "b"});
  files.remove(place / "b");
  CHECK(files.list(place.root()) == std::vector<std::string>{"a"});
  CHECK(error_kind([&] { files.make_folders(place / "a/file/below"); }) == 0);
}

TEST_CASE("a folder cannot be made below a file", "[core]") {
  Place place(GENERATE(true, false));
  test::write_whole(place.files(), place / "file", random_bytes(1, 9));
  CHECK(error_kind([&] { place.files().make_folders(place / "file/folder"); }) == kStorage);
}

TEST_CASE("a lock is held by one object at a time", "[core]") {
  Place place(GENERATE(true, false));
  auto first = place.files().try_lock(place / "lock");
  REQUIRE(first);
  CHECK_FALSE(place.files().try_lock(place / "lock"));
  CHECK(place.files().try_lock(place / "other"));
  first.reset();
  CHECK(place.files().try_lock(place / "lock"));
}

TEST_CASE("of two files of one name, held from the start, there is one", "[core]") {
  Place place(GENERATE(true, false));
  const auto first = place.files().create_held(place / "part");
  REQUIRE(first);
  first->append(random_bytes(10, 11));
  first->sync();
  CHECK_FALSE(place.files().create_held(place / "part"));
  CHECK(test::read_whole(place.files(), place / "part") == random_bytes(10, 11));
}

TEST_CASE("a scratch file has no name in its folder", "[core]") {
  const test::TempFolder folder;
  const auto file = posix_file_system().create_scratch(folder.path().string());
  file->append(random_bytes(1'000'000, 10));
  CHECK(posix_file_system().list(folder.path().string()).empty());
}

TEST_CASE("a folder, a pipe and a device are not files to read, and nothing waits", "[core]") {
  const test::TempFolder folder;
  const std::string pipe = folder.file("pipe");
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  std::string message;
  const auto open = [&](const std::string& path) {
    return error_kind([&] { posix_file_system().open(path); }, &message);
  };
  CHECK(open(folder.path().string()) == kStorage);
  CHECK_THAT(message, Catch::Contains("it is a folder, not a file"));
  CHECK(open(pipe) == kStorage);
  CHECK_THAT(message, Catch::Contains("it is a pipe, not a file"));
  CHECK(open("/dev/zero") == kStorage);
  CHECK_THAT(message, Catch::Contains("it is a device, not a file"));
  CHECK(posix_file_system().open_held(pipe) == nullptr);  // nothing that is held is one
  CHECK(posix_file_system().open_private(pipe) == nullptr);
}

/// No file of this process may grow beyond a size while this object lives.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int);
};

TEST_CASE("a write that the system cuts short fails whole and may be repeated", "[core]") {
  const test::TempFolder folder;
  const auto bytes = random_bytes(700'000, 11);
  const auto file = posix_file_system().create(folder.file("limited"));
  const auto part = [&](std::size_t at, std::size_t size) {
    return std::span(bytes).subspan(at, size);
  };
  file->append(part(0, 1000));
  {
    // The system writes 300,000 bytes and then refuses.
    const FileSizeLimit limit(300'000);
    std::string message;
    CHECK(error_kind([&] { file->append(part(1000, 500'000)); }, &message) == kStorage);
    CHECK_THAT(message, Catch::Contains("limited") && Catch::Contains("File too large"));
    CHECK(file->size_bytes() == 1000);
    file->append(part(1000, 200'000));
    file->append(part(201'000, 200'000));
    CHECK(error_kind([&] { file->sync(); }) == kStorage);
    CHECK(file->size_bytes() == 401'000);
  }
  file->append(part(401'000, 299'000));
  file->sync();
  CHECK(test::read_whole(posix_file_system(), folder.file("limited")) == bytes);
}

/// Scratch files that are counted.
struct Counted {
  explicit Counted(std::uint64_t limit)
      : account(std::make_shared<ScratchAccount>(limit, [] { return std::string("too much"); })) {}
  test::TempFolder folder;
  std::shared_ptr<ScratchAccount> account;
  std::unique_ptr<FileSystem> files = make_counting_file_system(account);
  ScratchFolder scratch{files.get(), folder.path().string()};
};

void append_some(WriteFile& file, std::size_t bytes) {
  file.append(std::vector<std::byte>(bytes, std::byte{7}));
}

TEST_CASE("scratch files keep to their limit together", "[core]") {
  const Counted counted(100);
  auto first = counted.scratch.create();
  const auto second = counted.scratch.create();
  append_some(*first, 60);
  append_some(*second, 40);
  REQUIRE_THROWS_WITH(append_some(*second, 1), "too much");
  CHECK(second->size_bytes() == 40);  // nothing of it
  append_some(*second, 0);

  auto reader = first->reader();
  first.reset();
  REQUIRE_THROWS_AS(append_some(*second, 1), Error);  // its reader still has it
  std::vector<std::byte> read(60);
  reader->read(0, read);
  CHECK(read.back() == std::byte{7});
  reader.reset();
  CHECK(counted.account->peak_bytes() == 100);
  append_some(*second, 60);
  REQUIRE_THROWS_AS(append_some(*second, 1), Error);
}

TEST_CASE("what scratch files took at most is known without a limit", "[core]") {
  const Counted counted(0);
  CHECK(counted.account->peak_bytes() == 0);
  auto first = counted.scratch.create();
  append_some(*first, 60);
  first.reset();
  const auto second = counted.scratch.create();
  append_some(*second, 50);
  CHECK(counted.account->peak_bytes() == 60);
  append_some(*second, 50);
  CHECK(counted.account->peak_bytes() == 100);
}

TEST_CASE("what an earlier run left counts, however much it is", "[core]") {
  const Counted counted(100);
  const std::string path = counted.folder.file(".left");
  {
    const auto left = posix_file_system().create_private(path);
    append_some(*left, 150);
    left->sync();
  }
  auto again = counted.files->reopen_resumable(path);
  REQUIRE(again != nullptr);
  CHECK(counted.account->is_over());
  CHECK(counted.account->peak_bytes() == 150);
  REQUIRE_THROWS_AS(append_some(*again, 1), Error);
  again->cut(90);
  CHECK_FALSE(counted.account->is_over());
  append_some(*again, 10);
  REQUIRE_THROWS_AS(append_some(*again, 1), Error);
  again.reset();
  append_some(*counted.scratch.create(), 100);
}

TEST_CASE("the usual limit counts what an earlier run left as free", "[core]") {
  ScratchAccount account(
      100, [] { return std::string("too much"); }, true);
  account.adopt(200);  // 20 more, but for which it would be free
  CHECK(account.is_over());
  account.give_back(200);
  account.take(120);
  CHECK_THROWS_AS(account.take(1), Error);
}

TEST_CASE("files with names have no limit", "[core]") {
  const Counted counted(10);
  const auto named = counted.files->create(counted.folder.file("named"));
  append_some(*named, 1000);
  CHECK(named->size_bytes() == 1000);
  CHECK(counted.account->peak_bytes() == 0);
}

TEST_CASE("the limit is a tenth of what is free, a GiB at least", "[core]") {
  constexpr std::uint64_t kGiB = 1ULL << 30;
  FileSystem& disk = posix_file_system();
  const std::uint64_t free = disk.free_bytes("/");
  const std::uint64_t limit = default_scratch_limit(disk, "/");
  CHECK(limit >= kGiB);
  if (free / 12 > kGiB) CHECK((limit > free / 12 && limit < free / 8));
  CHECK_THROWS_AS(default_scratch_limit(disk, "/no such folder"), Error);
}

}  // namespace
}  // namespace pounce
