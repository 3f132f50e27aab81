// SPDX-License-Identifier: Apache-2.0
//
// Files through pread and pwrite. No mmap: it would put whole stores into the process's resident
// memory, which is what the budget bounds.
//
// Three things are harder than they look:
// - A scratch file is read by many threads while one appends to it. Small appends are gathered in a
//   buffer; a reader that asks for bytes still in there has them written first, so that pread()
//   sees all that was appended and no reader ever looks into the buffer.
// - A folder that processes share has no owner. Whoever uses a file holds a shared flock() on it,
//   whoever removes one takes the exclusive lock first. A lock is on the file and not on its name:
//   between open() and flock() the name may have gone to another file, so every function that locks
//   asks afterwards whether the name still leads to what it locked.
//   A lock file is removed by whoever held it, which is the same race from the other side.
// - An fdatasync() that failed may succeed when it is called again although pages were dropped: a
//   failure is remembered.
#include "core/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <mutex>
#include <random>
#include <system_error>

#include "core/growing_file.h"
#include "core/posix_io.h"
#include "core/resumable_file.h"
#include "pounce/error.h"

namespace pounce {
namespace {

constexpr std::uint64_t kScratchShare = 10;  // of what is free: one in so many bytes

/// Opens a file to lock it. Another user's, in a folder that users share, may only be opened for
/// reading, which is enough for a lock (but on NFS).
int open_to_lock(const std::string& path, int flags, mode_t mode = 0) {
  const int fd = open_retrying(path, O_RDWR | O_NOFOLLOW | O_NONBLOCK | flags, mode);
  if (fd >= 0 || errno != EACCES) return fd;
  const int readable = open_retrying(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
  if (readable < 0) errno = EACCES;
  return readable;
}

/// No other process has it, but for those that it forks.
const std::string& process_token() {
  static const std::string token = [] {
    std::random_device random;
    return fmt::format("{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random());
  }();
  return token;
}

bool has_access_list(const std::string& path) {
  return ::getxattr(path.c_str(), "system.posix_acl_access", nullptr, 0) > 0;
}

std::int64_t nanoseconds(const timespec& time) {
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

class PosixReadFile final : public ReadFile {
 public:
  PosixReadFile(Descriptor fd, std::string path) : fd_(std::move(fd)), path_(std::move(path)) {
    const struct stat status = status_of(fd_.get(), path_);
    if (!S_ISREG(status.st_mode)) {
      throw Error(
          ErrorKind::storage,
          fmt::format("{}: cannot read: it is {}, not a file; {}", path_,
                      kind_of_file(status.st_mode),
                      S_ISDIR(status.st_mode) ? "specify a mesh, a splat scene or an image in it"
                                              : "write its contents to a file first"));
    }
    size_ = static_cast<std::uint64_t>(status.st_size);
  }
  std::uint64_t size_bytes() const override { return size_; }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    read_fully(fd_.get(), path_, offset, out);
  }

 private:
  Descriptor fd_;
  std::string path_;
  std::uint64_t size_ = 0;
};

class PosixWriteFile final : public WriteFile {
 public:
  PosixWriteFile(Descriptor fd, const std::string& path,
                 std::shared_ptr<ScratchAccount> account = nullptr)
      : file_(std::make_shared<GrowingFile>(std::move(fd), path, std::move(account))) {}
  void append(std::span<const std::byte> bytes) override { file_->append(bytes); }
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void sync() override { file_->sync(); }
  std::unique_ptr<ReadFile> reader() const override {
    file_->drop_buffer();
    return std::make_unique<GrowingReadFile>(file_);
  }

 private:
  std::shared_ptr<GrowingFile> file_;
};

class PosixFileLock final : public FileLock {
 public:
  PosixFileLock(Descriptor fd, bool was_ours) : fd_(std::move(fd)), was_ours_(was_ours) {}
  bool was_ours() const override { return was_ours_; }

 private:
  Descriptor fd_;  // closing it gives the flock back
  const bool was_ours_;
};

class PosixFileSystem final : public FileSystem {
 public:
  explicit PosixFileSystem(std::shared_ptr<ScratchAccount> account)
      : account_(std::move(account)) {}

  std::unique_ptr<ReadFile> open(const std::string& path) override {
    Descriptor fd(open_for_reading(path));
    if (fd.get() < 0) fail_storage(path, "open", errno);
    return std::make_unique<PosixReadFile>(std::move(fd), path);
  }

  // Readable, too: reader() gives out what was written so far.
  std::unique_ptr<WriteFile> create(const std::string& path) override {
    Descriptor fd(open_retrying(path, O_RDWR | O_CREAT | O_EXCL, 0666));
    if (fd.get() < 0) fail_to_change(path, "create", errno);
    return std::make_unique<PosixWriteFile>(std::move(fd), path);
  }

  std::unique_ptr<WriteFile> create_scratch(const std::string& folder) override {
    // A job whose output has no folder in its name works in the current one.
    const std::string where = folder.empty() ? "." : folder;
    Descriptor fd(open_scratch_file(where));
    if (fd.get() < 0) fail_to_change(where, "create a scratch file there", errno);
    return std::make_unique<PosixWriteFile>(std::move(fd), where + "/(scratch file)", account_);
  }

  std::unique_ptr<ResumableFile> create_resumable(const std::string& path) override {
    return pounce::create_resumable(path, account_);
  }
  std::unique_ptr<ResumableFile> reopen_resumable(const std::string& path) override {
    return pounce::reopen_resumable(path, account_);
  }

  // A file in its place, or a folder on the way that is a file: it is not there. Anything else
  // (a folder that may not be looked into) is no answer.
  bool exists(const std::string& path) override {
    struct stat status {};
    if (::stat(path.c_str(), &status) == 0) return true;
    if (errno != ENOENT && errno != ENOTDIR) fail_storage(path, "examine it", errno);
    return false;
  }

  void rename(const std::string& from, const std::string& to) override {
    if (::rename(from.c_str(), to.c_str()) != 0) fail_to_change(from, "rename to " + to, errno);
  }

  void remove(const std::string& path) override {
    if (::unlink(path.c_str()) != 0 && errno != ENOENT) fail_to_change(path, "remove", errno);
  }

  void make_folders(const std::string& path) override {
    std::error_code code;
    std::filesystem::create_directories(path, code);
    if (code) fail_to_change(path, "create the folder", code.value());
  }

  void sync_folder(const std::string& path) override {
    const Descriptor fd(open_retrying(path, O_RDONLY | O_DIRECTORY));
    if (fd.get() < 0) fail_storage(path, "open the folder", errno);
    // EINVAL: a file system that cannot sync folders has nothing to promise about them.
    if (!sync_retrying(fd.get()) && errno != EINVAL)
      fail_storage(path, "write the folder to the disk", errno);
  }

  std::vector<std::string> list(const std::string& folder) override {
    const int fd = open_retrying(folder, O_RDONLY | O_DIRECTORY | O_NOFOLLOW);
    const FolderStream stream(fd < 0 ? nullptr : ::fdopendir(fd));
    if (!stream) {
      const int reason = errno;
      if (fd >= 0) ::close(fd);
      // It may be another user's trap, or this user's way to a larger disk: say why it is not
      // followed.
      struct stat status {};
      if (::lstat(folder.c_str(), &status) == 0 && S_ISLNK(status.st_mode)) {
        throw Error(ErrorKind::storage,
                    fmt::format("{}: cannot list the folder: it is a link, and links are not "
                                "followed there; link the whole cache instead, or use a bind mount",
                                folder));
      }
      fail_storage(folder, "list the folder", reason);
    }
    std::vector<std::string> names;
    for (;;) {
      errno = 0;
      const dirent* entry = ::readdir(stream.get());
      if (entry == nullptr) break;
      const std::string name = entry->d_name;
      if (name != "." && name != "..") names.push_back(name);
    }
    if (errno != 0) fail_storage(folder, "list the folder", errno);
    std::sort(names.begin(), names.end());
    return names;
  }

  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    for (;;) {
      Descriptor fd(open_to_lock(path, O_CREAT, 0666));
      if (fd.get() < 0) fail_to_change(path, "open the lock file", errno);
      if (!lock_now(fd.get(), path, LOCK_EX)) return nullptr;
      if (!is_named(fd.get(), path)) continue;  // its last holder removed it
      // The number is for messages. Processes of other machines, or in containers, have the same
      // ones, hence what follows it.
      const std::string holder = fmt::format("{:<12}\n{}\n", ::getpid(), process_token());
      std::string last(holder.size(), ' ');
      const bool has_all =
          ::pread(fd.get(), last.data(), last.size(), 0) == static_cast<ssize_t>(last.size());
      const ssize_t written = ::pwrite(fd.get(), holder.data(), holder.size(), 0);
      // Better nobody's name than another's, as on a full disk.
      if (written != static_cast<ssize_t>(holder.size())) (void)!::ftruncate(fd.get(), 0);
      return std::make_unique<PosixFileLock>(std::move(fd), has_all && last == holder);
    }
  }

  std::unique_ptr<ReadFile> open_held(const std::string& path) override {
    Descriptor fd(open_retrying(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK));
    if (fd.get() < 0 && (errno == ENOENT || errno == ELOOP)) return nullptr;
    if (fd.get() < 0) fail_storage(path, "open", errno);
    if (!S_ISREG(status_of(fd.get(), path).st_mode)) return nullptr;
    // Whoever has it exclusively is removing it.
    if (!lock_now(fd.get(), path, LOCK_SH) || !is_named(fd.get(), path)) return nullptr;
    return std::make_unique<PosixReadFile>(std::move(fd), path);
  }

  std::unique_ptr<WriteFile> create_held(const std::string& path) override {
    return create_held_with(path, 0666);
  }

  std::unique_ptr<ReadFile> open_private(const std::string& path) override {
    Descriptor fd(open_retrying(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK));
    if (fd.get() < 0 && (errno == ENOENT || errno == ELOOP || errno == EACCES)) return nullptr;
    if (fd.get() < 0) fail_storage(path, "open", errno);
    const struct stat found = status_of(fd.get(), path);
    // Whoever may write to it could make it say anything: better not believed than locked.
    const bool is_ours = S_ISREG(found.st_mode) && found.st_uid == ::geteuid() &&
                         (found.st_mode & (S_IWGRP | S_IWOTH)) == 0;
    return is_ours ? std::make_unique<PosixReadFile>(std::move(fd), path) : nullptr;
  }

  std::unique_ptr<WriteFile> create_private(const std::string& path) override {
    return create_held_with(path, 0600);
  }

  bool remove_unheld(const std::string& path) override {
    for (;;) {
      const Descriptor fd(open_to_lock(path, 0));
      if (fd.get() < 0 && errno == ENOENT) return true;
      if (fd.get() < 0 && errno == ELOOP) {  // a link, which nobody holds
        remove(path);
        return true;
      }
      if (fd.get() < 0) fail_to_change(path, "remove", errno);
      if (!lock_now(fd.get(), path, LOCK_EX)) return false;
      if (!is_named(fd.get(), path)) continue;
      remove(path);
      return true;
    }
  }

  // Three ways, from the atomic one down: not every file system has the first two.
  bool rename_new(const std::string& from, const std::string& to) override {
    if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) {
      return true;
    }
    const bool unsupported = errno == EINVAL || errno == ENOSYS;
    if (unsupported && ::link(from.c_str(), to.c_str()) == 0) {
      remove(from);
      return true;
    }
    if (errno == EEXIST) return false;
    if (!unsupported) fail_to_change(from, "rename to " + to, errno);
    // Neither that nor hard links (FAT): the lock on the key must do.
    if (exists(to)) return false;
    rename(from, to);
    return true;
  }

  std::optional<FileStatus> status(const std::string& path) override {
    struct stat found {};
    if (::stat(path.c_str(), &found) != 0) {
      if (errno == ENOENT || errno == ENOTDIR) return std::nullopt;
      fail_storage(path, "examine it", errno);
    }
    return FileStatus{static_cast<std::uint64_t>(found.st_size),
                      nanoseconds(found.st_mtim),
                      nanoseconds(found.st_ctim),
                      found.st_dev,
                      found.st_ino,
                      S_ISDIR(found.st_mode)};
  }

  void touch(const std::string& path) override {
    // Sets the time of the last change alone.
    const timespec times[2] = {{0, UTIME_OMIT}, {0, UTIME_NOW}};
    if (::utimensat(AT_FDCWD, path.c_str(), times, AT_SYMLINK_NOFOLLOW) != 0)
      fail_to_change(path, "set its modification time", errno);
  }

  void resize(const std::string& path, std::uint64_t size_bytes) override {
    const Descriptor fd(open_retrying(path, O_WRONLY | O_NOFOLLOW | O_NONBLOCK));
    if (fd.get() < 0) fail_storage(path, "open", errno);
    while (::ftruncate(fd.get(), static_cast<off_t>(size_bytes)) != 0) {
      if (errno != EINTR) fail_to_change(path, "set its size", errno);
    }
  }

  bool is_writable(const std::string& folder) override {
    return ::access(folder.c_str(), W_OK | X_OK) == 0;
  }

  bool lets_all_write(const std::string& path, const std::string& folder) override {
    struct stat file {};
    struct stat around {};
    if (::stat(path.c_str(), &file) != 0 || ::stat(folder.c_str(), &around) != 0) return false;
    const mode_t writers = around.st_mode & (S_IWUSR | S_IWGRP | S_IWOTH);
    const bool same_group = (writers & S_IWGRP) == 0 || file.st_gid == around.st_gid;
    return file.st_uid == around.st_uid && same_group && (writers & ~file.st_mode) == 0 &&
           !has_access_list(path) && !has_access_list(folder);
  }

  std::uint64_t disk_bytes(const std::string& folder) override {
    const struct statvfs disk = disk_of(folder);
    return std::uint64_t{disk.f_blocks} * disk.f_frsize;
  }

  // A file system that says 0 blocks does not know.
  std::uint64_t free_bytes(const std::string& folder) override {
    const struct statvfs disk = disk_of(folder);
    return disk.f_blocks == 0 ? UINT64_MAX : std::uint64_t{disk.f_bavail} * disk.f_frsize;
  }

 private:
  static std::unique_ptr<WriteFile> create_held_with(const std::string& path, mode_t mode) {
    Descriptor fd(open_retrying(path, O_RDWR | O_CREAT | O_EXCL, mode));
    if (fd.get() < 0 && errno == EEXIST) return nullptr;
    if (fd.get() < 0) fail_to_change(path, "create", errno);
    // Between the two calls it was nobody's, and another process may have tidied it away.
    if (!lock_now(fd.get(), path, LOCK_SH) || !is_named(fd.get(), path)) return nullptr;
    return std::make_unique<PosixWriteFile>(std::move(fd), path);
  }

  static struct statvfs disk_of(const std::string& folder) {
    struct statvfs disk {};
    if (::statvfs(folder.c_str(), &disk) != 0)
      fail_storage(folder, "examine its file system", errno);
    return disk;
  }

  const std::shared_ptr<ScratchAccount> account_;
};

}  // namespace

FileSystem& posix_file_system() {
  static PosixFileSystem instance(nullptr);
  return instance;
}

std::unique_ptr<FileSystem> make_counting_file_system(std::shared_ptr<ScratchAccount> account) {
  return std::make_unique<PosixFileSystem>(std::move(account));
}

std::string lock_holder(FileSystem& files, const std::string& lock_path) {
  try {
    const auto file = files.open(lock_path);
    // A number of twenty digits is longer than any process's.
    std::string text(std::min<std::uint64_t>(file->size_bytes(), 20), '\0');
    file->read(0, std::as_writable_bytes(std::span(text)));
    text.resize(std::min(text.find_first_not_of("0123456789"), text.size()));
    if (!text.empty()) return "process " + text;
  } catch (const Error&) {
    // It just ended.
  }
  return "another process";
}

void ScratchAccount::take(std::uint64_t bytes) {
  // All of it or nothing, whatever other threads take meanwhile: the limit is never passed.
  std::uint64_t used = used_.load();
  do {
    const std::uint64_t limit = limit_;
    if (limit != 0 && (bytes > limit || used > limit - bytes))
      throw Error(ErrorKind::storage, refusal_());
  } while (!used_.compare_exchange_weak(used, used + bytes));
  note_peak(used + bytes);
}

void ScratchAccount::adopt(std::uint64_t bytes) noexcept {
  if (is_usual_ && limit_ != 0) limit_ += bytes / kScratchShare;
  note_peak(used_ += bytes);
}

void ScratchAccount::note_peak(std::uint64_t used) noexcept {
  for (std::uint64_t peak = peak_.load();
       peak < used && !peak_.compare_exchange_weak(peak, used);) {
  }
}

std::uint64_t default_scratch_limit(FileSystem& files, const std::string& folder) {
  constexpr std::uint64_t kLeast = 1ULL << 30;
  const std::uint64_t free = files.free_bytes(folder);
  return free == std::numeric_limits<std::uint64_t>::max() ? 0
                                                           : std::max(free / kScratchShare, kLeast);
}

}  // namespace pounce
