// SPDX-License-Identifier: Apache-2.0
//
// A disk that fails is no damaged image. The calls of this program fail on demand: it has a pread()
// of its own.
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>

#include "io/files/asset_file.h"
#include "io/image/write.h"
#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

namespace {

/// Reads at or behind this place of any file fail.
std::atomic<long long> fail_from{-1};

}  // namespace

extern "C" ssize_t pread(int file, void* out, size_t count, off_t offset) {
  const long long limit = fail_from;
  if (limit >= 0 && offset >= limit) {
    errno = EIO;
    return -1;
  }
  if (limit >= 0 && offset + static_cast<long long>(count) > limit)
    count = static_cast<size_t>(limit - offset);
  return syscall(SYS_pread64, file, out, count, offset);
}

using namespace pounce;
using Catch::Contains;

namespace {

struct Failure {
  ErrorKind kind = ErrorKind::internal;
  std::string message;
};

/// In this process, whose calls fail.
void read_here(const mesh::ImageRef& image) { test::read_all(image, 1000000, {}, Sandbox::off); }

template <class Action>
Failure failure_of(Action action) {
  try {
    action();
  } catch (const Error& e) {
    return {e.kind(), e.what()};
  }
  return {};
}

}  // namespace

TEST_CASE("a disk that fails while an image is read is told as such, wherever it fails",
          "[image]") {
  const auto [ending, depth] = GENERATE(table<std::string, Depth>(
      {{".png", Depth::u8}, {".jpg", Depth::u8}, {".tif", Depth::u16}, {".exr", Depth::half}}));
  const test::TempFolder folder;
  const std::string path = folder.file("a" + ending);
  {
    io::ImageWriter writer(path, {64, 300, 3, depth, depth >= Depth::half, false});
    std::vector<std::byte> rows(std::size_t{64} * 300 * 3 * 2);
    std::uint32_t state = 1;
    for (std::byte& b : rows)
      b = static_cast<std::byte>((state = state * 1664525 + 1013904223) >> 26);
    writer.write_rows(300, rows.data());
    writer.commit();
  }
  const auto size = static_cast<long long>(test::read_file(path).size());
  for (const long long from : {0LL, 5LL, 40LL, 200LL, size / 2, size - 1}) {
    CAPTURE(ending, from);
    fail_from = from;
    const Failure reading = failure_of([&] { read_here(test::at_path(path)); });
    const Failure hashing = failure_of([&] { io::hash_image(test::at_path(path)); });
    fail_from = -1;
    CHECK(reading.kind == ErrorKind::storage);
    CHECK(reading.message == path + ": cannot read: Input/output error");
    CHECK(hashing.kind == ErrorKind::storage);
    CHECK(hashing.message == path + ": cannot read: Input/output error");
  }
  // Named by its place in another file: both are said.
  mesh::ImageRef inside = test::at_path(path);
  inside.label = "head.glb image 0";
  fail_from = 40;
  CHECK(failure_of([&] { read_here(inside); }).message ==
        "head.glb image 0: cannot read " + path + ": Input/output error");
  fail_from = -1;
}

TEST_CASE("what is there but cannot be opened as a file is told as such", "[image]") {
  const test::TempFolder folder;
  const Failure absent = failure_of([&] { io::ImageReader(folder.file("absent.png")); });
  CHECK(absent.kind == ErrorKind::storage);
  CHECK_THAT(absent.message, Contains("absent.png: cannot open: No such file or directory"));
  const std::string pipe = folder.file("pipe.png");
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  for (const auto& [path, kind] : {std::pair<std::string, std::string>{pipe, "a pipe"},
                                   {folder.file(""), "a folder"},
                                   {"/dev/zero", "a device"}}) {
    const Failure failure = failure_of([&] { io::ImageReader{path}; });
    CHECK(failure.kind == ErrorKind::storage);
    CHECK_THAT(failure.message, Contains(kind));
  }
}
