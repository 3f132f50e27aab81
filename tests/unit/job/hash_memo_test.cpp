// SPDX-License-Identifier: Apache-2.0
#include "job/hash_memo.h"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "support/bytes.h"
#include "support/failing_file_system.h"
#include "support/test_data.h"

namespace pounce::job {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kSize = HashMemo::kLeastBytes;

/// The real files, at chosen times.
class Dated final : public test::FailingFileSystem {
 public:
  using FailingFileSystem::FailingFileSystem;
  std::int64_t shift_ns = -10'000'000'000;  ///< ten seconds ago
  std::optional<FileStatus> status(const std::string& path) override {
    auto status = FailingFileSystem::status(path);
    if (status) {
      status->changed_ns += shift_ns;
      status->modified_ns += shift_ns;
    }
    return status;
  }
};

struct Memo {
  test::TempFolder folder;
  Dated files{posix_file_system()};
  std::string input = folder.file("scene.ply"), path = folder.file("hashes");
  int computed = 0;

  Memo() {
    fs::create_directory(folder.file("tmp"));
    std::ofstream(input) << "first";
    fs::resize_file(input, kSize);
  }
  Hash128 get(std::uint64_t offset = 0, std::uint64_t size = kSize) {
    HashMemo memo(files, path, folder.file("tmp"));  // each time as a new process would
    return memo.get(input, offset, size, [&] {
      ++computed;
      return Hash128{1, static_cast<std::uint64_t>(computed)};
    });
  }
};

TEST_CASE("a large file is hashed once, and again when anything of it changed", "[job]") {
  Memo memo;
  const Hash128 first = memo.get();
  CHECK(memo.get() == first);
  CHECK(memo.computed == 1);
  memo.get(4096);  // another part
  CHECK(memo.computed == 2);
  CHECK(memo.get() == first);
  // The same size and, as a program may set it, the same time: the change is still seen.
  const auto time = fs::last_write_time(memo.input);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  std::fstream(memo.input, std::ios::in | std::ios::out) << "other";
  fs::last_write_time(memo.input, time);
  CHECK(memo.get() != first);
  CHECK(memo.computed == 3);
  CHECK(fs::is_empty(memo.folder.file("tmp")));
}

TEST_CASE("what is small, or was changed just now, is not remembered", "[job]") {
  Memo memo;
  memo.get(0, kSize - 1);
  memo.get(0, kSize - 1);
  CHECK(memo.computed == 2);
  memo.files.shift_ns = -1'000'000'000;  // a second ago: a change now could carry the same time
  memo.get();
  memo.get();
  CHECK(memo.computed == 4);
  CHECK_FALSE(fs::exists(memo.path));
}

TEST_CASE("a damaged memo is ignored and replaced", "[job]") {
  Memo memo;
  const Hash128 first = memo.get();
  const auto bytes = test::read_whole(posix_file_system(), memo.path);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    auto bad = bytes;
    bad[i] ^= std::byte{16};
    test::write_whole(posix_file_system(), memo.path, bad);
    CHECK(memo.get() != first);
    test::write_whole(posix_file_system(), memo.path, std::span(bytes).first(i));
    CHECK(memo.get() != first);
  }
  CHECK(memo.computed == 1 + 2 * static_cast<int>(bytes.size()));
  test::write_whole(posix_file_system(), memo.path, bytes);
  CHECK(memo.get() == first);
}

TEST_CASE("a memo that somebody else may have written is not believed", "[job]") {
  Memo memo;
  const Hash128 first = memo.get();
  for (const fs::perms writer : {fs::perms::group_write, fs::perms::others_write}) {
    fs::permissions(memo.path, writer, fs::perm_options::add);
    CHECK(memo.get() != first);  // and is replaced
    CHECK((fs::status(memo.path).permissions() & fs::perms(077)) == fs::perms::none);
  }
  const Hash128 last = memo.get();
  CHECK(memo.computed == 3);
  fs::rename(memo.path, memo.folder.file("elsewhere"));
  fs::create_symlink(memo.folder.file("elsewhere"), memo.path);
  CHECK(memo.get() != last);
  fs::remove(memo.path);
  fs::rename(memo.folder.file("elsewhere"), memo.path);
  CHECK(memo.get() == last);
  if (::chown(memo.path.c_str(), 65534, 65534) == 0) CHECK(memo.get() != last);  // only as root
}

TEST_CASE("a memo that cannot be written costs nothing but time", "[job]") {
  Memo memo;
  fs::remove(memo.folder.file("tmp"));
  memo.get();
  memo.get();
  CHECK(memo.computed == 2);
}

}  // namespace
}  // namespace pounce::job
