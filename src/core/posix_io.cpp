// SPDX-License-Identifier: Apache-2.0
//
// Everything here answers one question: what does a system call mean that did not do all it was
// asked for? Interrupted by a signal: again. A short read or write: the rest. A refusal: an Error
// whose sentence ends with what the user can do, since "No space left on device" names neither the
// folder nor the cure.
#include "core/posix_io.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <mutex>
#include <set>
#include <string_view>
#include <system_error>

#include "pounce/error.h"

namespace pounce {
namespace {

constexpr const char* kAnotherFolder = "; choose a folder that this user may write to";

[[noreturn]] void fail(const std::string& path, const std::string& what, int code,
                       const char* cure) {
  throw Error(
      ErrorKind::storage,
      fmt::format("{}: cannot {}: {}{}", path, what, std::generic_category().message(code), cure),
      is_passing(code));
}

constexpr std::string_view kScratchPrefix = ".pounce-", kScratchRandom = "XXXXXX";

/// As mkostemp() makes them. Nothing else may be removed in a folder that is not ours.
bool is_scratch_name(std::string_view name) {
  const auto is_letter = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
  };
  return name.size() == kScratchPrefix.size() + kScratchRandom.size() &&
         name.starts_with(kScratchPrefix) &&
         std::all_of(name.begin() + kScratchPrefix.size(), name.end(), is_letter);
}

/// Removes empty files of such names that are this user's. One may be of a process that is about to
/// remove it itself: it has the file open and misses nothing. Once per folder and process: a folder
/// may have a million files. Failures do not matter.
void remove_left_scratch(const std::string& folder) {
  static std::mutex mutex;  // guards `seen`, and keeps a second thread out until all are gone
  static std::set<std::pair<dev_t, ino_t>> seen;  // by identity: a folder may have several names
  const FolderStream stream(::opendir(folder.c_str()));
  struct stat status {};
  if (!stream || ::fstat(::dirfd(stream.get()), &status) != 0) return;
  const std::lock_guard lock(mutex);
  if (!seen.insert({status.st_dev, status.st_ino}).second) return;
  while (const dirent* entry = ::readdir(stream.get())) {
    struct stat file {};
    if (!is_scratch_name(entry->d_name) ||
        ::fstatat(::dirfd(stream.get()), entry->d_name, &file, AT_SYMLINK_NOFOLLOW) != 0)
      continue;
    if (S_ISREG(file.st_mode) && file.st_size == 0 && file.st_uid == ::geteuid())
      ::unlinkat(::dirfd(stream.get()), entry->d_name, 0);
  }
}

}  // namespace

bool is_passing(int code) noexcept {
  return code == ENOSPC || code == EDQUOT || code == EIO || code == ESTALE;
}

const char* storage_advice(int code) {
  switch (code) {
    case ENOSPC:
    case EDQUOT:
      return "; free some space or choose another folder";
    case EFBIG:
      return "; raise the limit of file sizes (ulimit -f)";
    case EMFILE:
    case ENFILE:
      return "; raise the limit of open files (ulimit -n)";
    case EROFS:
      return kAnotherFolder;
    case ENOLCK:
    case EOPNOTSUPP:
    case ENOSYS:
      return "; its file system does not support this, choose a folder on another one";
    default:
      return "";
  }
}

void fail_storage(const std::string& path, const std::string& what, int code) {
  fail(path, what, code, storage_advice(code));
}

// Whoever may not read a file must ask its owner; who may not write can write elsewhere.
void fail_to_change(const std::string& path, const std::string& what, int code) {
  fail(path, what, code, code == EACCES || code == EPERM ? kAnotherFolder : storage_advice(code));
}

Descriptor::~Descriptor() {
  if (fd_ >= 0) ::close(fd_);
}

int open_retrying(const std::string& path, int flags, mode_t mode) {
  for (;;) {
    // Never inherited: a program that a caller of the library starts must not keep files and locks.
    const int fd = ::open(path.c_str(), flags | O_CLOEXEC, mode);
    if (fd >= 0 || errno != EINTR) return fd;
  }
}

bool sync_retrying(int fd) {
  while (::fsync(fd) != 0) {
    if (errno != EINTR) return false;
  }
  return true;
}

int open_for_reading(const std::string& path) {
  constexpr int kFlags = O_RDONLY | O_NOCTTY;
  const int fd = open_retrying(path, kFlags | O_NONBLOCK);
  if (fd >= 0 || errno != EWOULDBLOCK) return fd;
  // O_NONBLOCK makes a pipe open at once; on a regular file it only shows where
  // a file server has a lease on it, which it gives back within seconds to whoever waits.
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return -1;
  return open_retrying(path, kFlags);
}

int open_scratch_file(const std::string& folder) {
  // Never had a name: nothing to tidy up, whenever the process dies.
  int file = open_retrying(folder, O_TMPFILE | O_RDWR | O_EXCL, 0600);
  // These three are how kernels and file systems say that they know no O_TMPFILE; anything else is
  // the reason that the user must hear.
  if (file >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL)) return file;
  remove_left_scratch(folder);
  // NFS and FAT have no such files. There it has a name for a moment.
  std::string path = folder + "/" + std::string(kScratchPrefix) + std::string(kScratchRandom);
  file = ::mkostemp(path.data(), O_CLOEXEC);
  if (file >= 0) ::unlink(path.c_str());
  return file;
}

bool lock_now(int fd, const std::string& path, int kind) {
  while (::flock(fd, kind | LOCK_NB) != 0) {
    if (errno == EINTR) continue;
    if (errno == EWOULDBLOCK) return false;
    fail_storage(path, "lock", errno);
  }
  return true;
}

bool is_named(int fd, const std::string& path) {
  const struct stat here = status_of(fd, path);
  struct stat there {};
  if (::stat(path.c_str(), &there) != 0) {
    if (errno == ENOENT) return false;
    fail_storage(path, "examine it", errno);
  }
  return here.st_dev == there.st_dev && here.st_ino == there.st_ino;
}

struct stat status_of(int fd, const std::string& path) {
  struct stat status {};
  if (::fstat(fd, &status) != 0) fail_storage(path, "examine it", errno);
  return status;
}

const char* kind_of_file(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a pipe";
  return S_ISSOCK(mode) ? "a socket" : "a device";
}

void read_fully(int fd, const std::string& path, std::uint64_t offset, std::span<std::byte> out) {
  while (!out.empty()) {
    const ssize_t got = ::pread(fd, out.data(), out.size(), static_cast<off_t>(offset));
    if (got < 0) {
      if (errno == EINTR) continue;
      fail_storage(path, "read", errno);
    }
    if (got == 0) {  // somebody cut it off since its size was asked for
      throw Error(ErrorKind::storage,
                  fmt::format("{}: cannot read: the file ends at byte {}, {} bytes are missing",
                              path, offset, out.size()));
    }
    offset += static_cast<std::uint64_t>(got);
    out = out.subspan(static_cast<std::size_t>(got));
  }
}

// A disk that fills up takes what fits first; the next call then says why the rest does not.
void write_fully(int fd, const std::string& path, std::uint64_t offset,
                 std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t put = ::pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (put < 0) {
      if (errno == EINTR) continue;
      fail_storage(path, "write", errno);
    }
    offset += static_cast<std::uint64_t>(put);
    bytes = bytes.subspan(static_cast<std::size_t>(put));
  }
}

}  // namespace pounce
