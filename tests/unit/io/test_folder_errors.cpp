// SPDX-License-Identifier: Apache-2.0
//
// Folders that cannot be looked at or synced, and file systems without nameless files. This program
// has some of the system's calls of its own, which fail on demand.
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdarg>
#include <filesystem>
#include <fstream>

#include "core/file.h"
#include "io/files/output_file.h"
#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

namespace {

std::atomic<bool> looks_fail{false}, folder_syncs_fail{false}, has_no_nameless{false};

}  // namespace

extern "C" int stat(const char* path, struct stat* out) noexcept {
  if (looks_fail) {
    errno = EACCES;
    return -1;
  }
  return static_cast<int>(syscall(SYS_newfstatat, AT_FDCWD, path, out, 0));
}

extern "C" int fsync(int file) {
  struct stat status {};
  if (folder_syncs_fail && fstat(file, &status) == 0 && S_ISDIR(status.st_mode)) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(syscall(SYS_fsync, file));
}

extern "C" int open(const char* path, int flags, ...) {
  std::va_list rest;
  va_start(rest, flags);
  const bool makes = (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE;
  const mode_t mode = makes ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  if (has_no_nameless && (flags & O_TMPFILE) == O_TMPFILE) {
    errno = EOPNOTSUPP;
    return -1;
  }
  return static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, flags, mode));
}

using namespace pounce;
namespace fs = std::filesystem;

TEST_CASE("folders are made, and found, where not even the root can be looked at", "[output]") {
  const test::TempFolder folder;
  const std::string wanted = folder.file("a/b");
  looks_fail = true;
  try {  // all is taken for missing, the root too; it is there all the same
    const io::NewFolders made(wanted);
    looks_fail = false;
    CHECK(fs::is_directory(wanted));
    looks_fail = true;
  } catch (const Error& e) {
    looks_fail = false;
    FAIL(e.what());
  }
  const std::string found = io::existing_folder(wanted);
  looks_fail = false;
  CHECK(found == ".");
}

TEST_CASE("a file that is in place is not told as one that cannot be written", "[output]") {
  const test::TempFolder folder;
  const std::string path = folder.file("image.png");
  folder_syncs_fail = true;
  std::string said;
  try {
    io::OutputFile file(path);
    std::fputs("new", file.stream());
    file.commit();
  } catch (const Error& e) {
    said = e.what();
    CHECK(e.kind() == ErrorKind::storage);
  }
  folder_syncs_fail = false;
  CHECK(test::read_file(path) == "new");
  CHECK(said.starts_with(path + ": was written, but its folder could not be synced"));
  CHECK(said.find("Input/output error") != std::string::npos);
}

TEST_CASE("scratch files that a killed process left are removed", "[output]") {
  const test::TempFolder folder;
  // What it leaves between mkostemp() and unlink(), and what only looks like it.
  for (const char* name : {".pounce-aB3dE6", ".pounce-000000"}) std::ofstream(folder.file(name));
  std::ofstream(folder.file(".pounce-abcdeg")) << "something";
  for (const char* name : {".pounce-abc", ".pounce-abc_ef", "pounce-abcdef"})
    std::ofstream(folder.file(name));
  has_no_nameless = true;
  const auto file = posix_file_system().create_scratch(folder.path().string());
  has_no_nameless = false;
  REQUIRE(file != nullptr);
  const std::vector<std::string> left = posix_file_system().list(folder.path().string());
  CHECK(left == std::vector<std::string>{".pounce-abc", ".pounce-abc_ef", ".pounce-abcdeg",
                                         "pounce-abcdef"});
}
