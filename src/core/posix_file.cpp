// SPDX-License-Identifier: Apache-2.0
//
// Files through pread and pwrite. No mmap: it would put whole stores into the process's resident
// memory.
#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <system_error>
#include <utility>

#include "core/file.h"
#include "core/open_file.h"
#include "core/scratch_file.h"
#include "core/storage_advice.h"
#include "pounce/error.h"

namespace pounce {

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
      return "; choose a folder that this user may write to";
    case ENOLCK:
    case EOPNOTSUPP:
    case ENOSYS:
      return "; its file system cannot do that, choose a folder on another one";
    default:
      return "";
  }
}

namespace {

// Chunks are 1 KB to 1 MB: small ones are gathered so that a write costs no more than the copy.
constexpr std::size_t kWriteBufferBytes = 256u << 10;

[[noreturn]] void fail(const std::string& path, const char* what, int code,
                       const char* cure = nullptr) {
  throw Error(ErrorKind::storage,
              fmt::format("{}: cannot {}: {}{}", path, what, std::generic_category().message(code),
                          cure != nullptr ? cure : storage_advice(code)));
}

/// Where something should have been written or removed.
[[noreturn]] void fail_to_change(const std::string& path, const char* what, int code) {
  const bool forbidden = code == EACCES || code == EPERM;
  fail(path, what, code, forbidden ? "; choose a folder that this user may write to" : nullptr);
}

bool is_regular(int fd, const std::string& path) {
  struct stat status {};
  if (::fstat(fd, &status) != 0) fail(path, "look at it", errno);
  return S_ISREG(status.st_mode);
}

/// A file descriptor that is closed with this object.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  int release() { return std::exchange(fd_, -1); }

 private:
  int fd_;
};

int open_retrying(const char* path, int flags, mode_t mode = 0) {
  for (;;) {
    const int fd = ::open(path, flags | O_CLOEXEC, mode);
    if (fd >= 0 || errno != EINTR) return fd;
  }
}

/// Opens a file to lock it. Another user's, in a folder that users share, may only be opened for
/// reading, which is enough for a lock (but on NFS).
int open_to_lock(const char* path, int flags, mode_t mode = 0) {
  const int fd = open_retrying(path, O_RDWR | O_NOFOLLOW | O_NONBLOCK | flags, mode);
  if (fd >= 0 || errno != EACCES) return fd;
  const int readable = open_retrying(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
  if (readable < 0) errno = EACCES;
  return readable;
}

/// Takes a lock (LOCK_SH or LOCK_EX) without waiting; false if somebody else has it.
bool lock_now(int fd, const std::string& path, int kind) {
  while (::flock(fd, kind | LOCK_NB) != 0) {
    if (errno == EINTR) continue;
    if (errno == EWOULDBLOCK) return false;
    fail(path, "lock", errno);
  }
  return true;
}

/// Whether `path` names the open file: another process may have removed or replaced it.
bool is_named(int fd, const std::string& path) {
  struct stat here {
  }, there{};
  if (::fstat(fd, &here) != 0) fail(path, "look at it", errno);
  if (::stat(path.c_str(), &there) != 0) {
    if (errno == ENOENT) return false;
    fail(path, "look at it", errno);
  }
  return here.st_dev == there.st_dev && here.st_ino == there.st_ino;
}

std::int64_t nanoseconds(const timespec& time) {
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

void read_fully(int fd, const std::string& path, std::uint64_t offset, std::span<std::byte> out) {
  while (!out.empty()) {
    const ssize_t got = ::pread(fd, out.data(), out.size(), static_cast<off_t>(offset));
    if (got < 0) {
      if (errno == EINTR) continue;
      fail(path, "read", errno);
    }
    if (got == 0) {
      throw Error(ErrorKind::storage,
                  fmt::format("{}: cannot read: the file ends at byte {}, {} bytes are missing",
                              path, offset, out.size()));
    }
    offset += static_cast<std::uint64_t>(got);
    out = out.subspan(static_cast<std::size_t>(got));
  }
}

void write_fully(int fd, const std::string& path, std::uint64_t offset,
                 std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t put = ::pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (put < 0) {
      if (errno == EINTR) continue;
      fail(path, "write", errno);
    }
    offset += static_cast<std::uint64_t>(put);
    bytes = bytes.subspan(static_cast<std::size_t>(put));
  }
}

class PosixReadFile final : public ReadFile {
 public:
  PosixReadFile(int fd, std::string path) : fd_(fd), path_(std::move(path)) {
    struct stat status {};
    if (::fstat(fd_.get(), &status) != 0) fail(path_, "read the size", errno);
    if (!S_ISREG(status.st_mode)) {
      throw Error(
          ErrorKind::storage,
          fmt::format("{}: cannot read: it is {}, not a file; {}", path_,
                      kind_of_file(status.st_mode),
                      S_ISDIR(status.st_mode) ? "name a mesh, a splat scene or an image in it"
                                              : "write what should be read into a file first"));
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

/// What a growing file and its readers share. Bytes below written() are in the file, the rest in
/// the buffer. A failed write changes neither, so that it may be tried again.
class GrowingFile {
 public:
  GrowingFile(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}

  void append(std::span<const std::byte> bytes) {
    const std::lock_guard lock(mutex_);
    if (buffer_.size() + bytes.size() > kWriteBufferBytes) flush_locked();
    if (bytes.size() >= kWriteBufferBytes) {
      const std::uint64_t at = written_.load(std::memory_order_relaxed);
      write_fully(fd_.get(), path_, at, bytes);
      written_.store(at + bytes.size(), std::memory_order_release);
    } else {
      if (buffer_.capacity() == 0) buffer_.reserve(kWriteBufferBytes);
      buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    }
  }

  std::uint64_t size_bytes() const {
    const std::lock_guard lock(mutex_);
    return written_.load(std::memory_order_relaxed) + buffer_.size();
  }

  /// Empties the buffer and gives its memory back: files that are only read from now on hold none.
  void flush() {
    const std::lock_guard lock(mutex_);
    flush_locked();
    std::vector<std::byte>().swap(buffer_);
  }

  void sync() {
    flush();
    // After a failed fdatasync the kernel may have dropped the pages and report success next time.
    if (sync_failed_) fail(path_, "write to the disk", EIO);
    while (::fdatasync(fd_.get()) != 0) {
      if (errno == EINTR) continue;
      sync_failed_ = true;
      fail(path_, "write to the disk", errno);
    }
  }

  void read(std::uint64_t offset, std::span<std::byte> out) {
    if (offset + out.size() > written_.load(std::memory_order_acquire)) {
      const std::lock_guard lock(mutex_);
      flush_locked();
    }
    read_fully(fd_.get(), path_, offset, out);
  }

 private:
  void flush_locked() {
    if (buffer_.empty()) return;
    const std::uint64_t at = written_.load(std::memory_order_relaxed);
    write_fully(fd_.get(), path_, at, buffer_);
    written_.store(at + buffer_.size(), std::memory_order_release);
    buffer_.clear();
  }

  const Descriptor fd_;
  const std::string path_;
  mutable std::mutex mutex_;  // guards buffer_ and changes of written_
  std::vector<std::byte> buffer_;
  std::atomic<std::uint64_t> written_{0};
  bool sync_failed_ = false;
};

class GrowingReadFile final : public ReadFile {
 public:
  explicit GrowingReadFile(std::shared_ptr<GrowingFile> file) : file_(std::move(file)) {}
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    file_->read(offset, out);
  }

 private:
  std::shared_ptr<GrowingFile> file_;
};

class PosixWriteFile final : public WriteFile {
 public:
  PosixWriteFile(int fd, std::string path)
      : file_(std::make_shared<GrowingFile>(fd, std::move(path))) {}
  void append(std::span<const std::byte> bytes) override { file_->append(bytes); }
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void sync() override { file_->sync(); }
  std::unique_ptr<ReadFile> reader() const override {
    file_->flush();
    return std::make_unique<GrowingReadFile>(file_);
  }

 private:
  std::shared_ptr<GrowingFile> file_;
};

class PosixFileLock final : public FileLock {
 public:
  explicit PosixFileLock(std::unique_ptr<Descriptor> fd) : fd_(std::move(fd)) {}

 private:
  std::unique_ptr<Descriptor> fd_;  // closing it gives the flock back
};

int close_folder(DIR* folder) { return folder == nullptr ? 0 : ::closedir(folder); }

class PosixFileSystem final : public FileSystem {
 public:
  std::unique_ptr<ReadFile> open(const std::string& path) override {
    const int fd = open_for_reading(path);
    if (fd < 0) fail(path, "open", errno);
    return std::make_unique<PosixReadFile>(fd, path);
  }

  std::unique_ptr<WriteFile> create(const std::string& path) override {
    const int fd = open_retrying(path.c_str(), O_RDWR | O_CREAT | O_EXCL, 0666);
    if (fd < 0) fail_to_change(path, "create", errno);
    return std::make_unique<PosixWriteFile>(fd, path);
  }

  std::unique_ptr<WriteFile> create_scratch(const std::string& folder) override {
    const std::string where = folder.empty() ? "." : folder;
    const std::string name = where + "/(scratch file)";
    const int fd = open_scratch_file(where);
    if (fd < 0) fail_to_change(where, "create a scratch file there", errno);
    return std::make_unique<PosixWriteFile>(fd, name);
  }

  bool exists(const std::string& path) override {
    struct stat status {};
    if (::stat(path.c_str(), &status) == 0) return true;
    if (errno != ENOENT && errno != ENOTDIR) fail(path, "look at it", errno);
    return false;
  }

  void rename(const std::string& from, const std::string& to) override {
    if (::rename(from.c_str(), to.c_str()) != 0) {
      fail_to_change(from, fmt::format("rename to {}", to).c_str(), errno);
    }
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
    const Descriptor fd(open_retrying(path.c_str(), O_RDONLY | O_DIRECTORY));
    if (fd.get() < 0) fail(path, "open the folder", errno);
    // EINVAL: a file system that cannot sync folders has nothing to promise about them.
    while (::fsync(fd.get()) != 0) {
      if (errno == EINTR) continue;
      if (errno == EINVAL) return;
      fail(path, "write the folder to the disk", errno);
    }
  }

  std::vector<std::string> list(const std::string& folder) override {
    const int fd = open_retrying(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW);
    const std::unique_ptr<DIR, int (*)(DIR*)> stream(fd < 0 ? nullptr : ::fdopendir(fd),
                                                     close_folder);
    if (!stream) {
      const int reason = errno;
      struct stat status {};
      if (::lstat(folder.c_str(), &status) == 0 && S_ISLNK(status.st_mode)) {
        throw Error(ErrorKind::storage,
                    fmt::format("{}: cannot list the folder: it is a link, which is not followed "
                                "there; make a link of the whole cache instead, or bind-mount it",
                                folder));
      }
      fail(folder, "list the folder", reason);
    }
    std::vector<std::string> names;
    for (;;) {
      errno = 0;
      const dirent* entry = ::readdir(stream.get());
      if (entry == nullptr) break;
      const std::string name = entry->d_name;
      if (name != "." && name != "..") names.push_back(name);
    }
    if (errno != 0) fail(folder, "list the folder", errno);
    std::sort(names.begin(), names.end());
    return names;
  }

  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    for (;;) {
      auto fd = std::make_unique<Descriptor>(open_to_lock(path.c_str(), O_CREAT, 0666));
      if (fd->get() < 0) fail_to_change(path, "open the lock file", errno);
      if (!lock_now(fd->get(), path, LOCK_EX)) return nullptr;
      if (!is_named(fd->get(), path)) continue;  // its last holder removed it
      // Who holds it is for messages only: on a full disk it stays unknown.
      const std::string holder = fmt::format("{:<12}\n", ::getpid());
      (void)!::pwrite(fd->get(), holder.data(), holder.size(), 0);
      return std::make_unique<PosixFileLock>(std::move(fd));
    }
  }

  std::unique_ptr<ReadFile> open_held(const std::string& path) override {
    const int fd = open_retrying(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0 && (errno == ENOENT || errno == ELOOP)) return nullptr;
    Descriptor held(fd);
    if (fd < 0) fail(path, "open", errno);
    if (!is_regular(fd, path)) return nullptr;
    auto file = std::make_unique<PosixReadFile>(held.release(), path);
    if (!lock_now(fd, path, LOCK_SH) || !is_named(fd, path)) return nullptr;
    return file;
  }

  std::unique_ptr<WriteFile> create_held(const std::string& path) override {
    return create_held_with(path, 0666);
  }

  static std::unique_ptr<WriteFile> create_held_with(const std::string& path, mode_t mode) {
    const int fd = open_retrying(path.c_str(), O_RDWR | O_CREAT | O_EXCL, mode);
    if (fd < 0 && errno == EEXIST) return nullptr;
    if (fd < 0) fail_to_change(path, "create", errno);
    auto file = std::make_unique<PosixWriteFile>(fd, path);
    if (!lock_now(fd, path, LOCK_SH) || !is_named(fd, path)) return nullptr;
    return file;
  }

  std::unique_ptr<ReadFile> open_private(const std::string& path) override {
    const int fd = open_retrying(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0 && (errno == ENOENT || errno == ELOOP || errno == EACCES)) return nullptr;
    Descriptor held(fd);
    if (fd < 0) fail(path, "open", errno);
    if (!is_regular(fd, path)) return nullptr;
    auto file = std::make_unique<PosixReadFile>(held.release(), path);
    struct stat found {};
    if (::fstat(fd, &found) != 0) fail(path, "look at it", errno);
    const bool ours = found.st_uid == ::geteuid() && (found.st_mode & (S_IWGRP | S_IWOTH)) == 0;
    return ours ? std::move(file) : nullptr;
  }

  std::unique_ptr<WriteFile> create_private(const std::string& path) override {
    return create_held_with(path, 0600);
  }

  bool remove_unheld(const std::string& path) override {
    for (;;) {
      const Descriptor fd(open_to_lock(path.c_str(), 0));
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
    if (!unsupported) fail_to_change(from, fmt::format("rename to {}", to).c_str(), errno);
    // Neither that nor hard links (FAT): the lock on the key must do.
    if (exists(to)) return false;
    rename(from, to);
    return true;
  }

  std::optional<FileStatus> status(const std::string& path) override {
    struct stat found {};
    if (::stat(path.c_str(), &found) != 0) {
      if (errno == ENOENT || errno == ENOTDIR) return std::nullopt;
      fail(path, "look at it", errno);
    }
    return FileStatus{static_cast<std::uint64_t>(found.st_size),
                      nanoseconds(found.st_mtim),
                      nanoseconds(found.st_ctim),
                      found.st_dev,
                      found.st_ino,
                      S_ISDIR(found.st_mode)};
  }

  void touch(const std::string& path) override {
    const timespec times[2] = {{0, UTIME_OMIT}, {0, UTIME_NOW}};
    if (::utimensat(AT_FDCWD, path.c_str(), times, AT_SYMLINK_NOFOLLOW) != 0)
      fail_to_change(path, "set its time", errno);
  }

  void resize(const std::string& path, std::uint64_t size_bytes) override {
    const Descriptor fd(open_retrying(path.c_str(), O_WRONLY | O_NOFOLLOW | O_NONBLOCK));
    if (fd.get() < 0) fail(path, "open", errno);
    while (::ftruncate(fd.get(), static_cast<off_t>(size_bytes)) != 0) {
      if (errno != EINTR) fail_to_change(path, "set its size", errno);
    }
  }

  bool is_writable(const std::string& folder) override {
    return ::access(folder.c_str(), W_OK | X_OK) == 0;
  }

  std::uint64_t disk_bytes(const std::string& folder) override {
    struct statvfs disk {};
    if (::statvfs(folder.c_str(), &disk) != 0) fail(folder, "look at its file system", errno);
    return std::uint64_t{disk.f_blocks} * disk.f_frsize;
  }

  std::uint64_t free_bytes(const std::string& folder) override {
    struct statvfs disk {};
    if (::statvfs(folder.c_str(), &disk) != 0) fail(folder, "look at its file system", errno);
    return disk.f_blocks == 0 ? UINT64_MAX : std::uint64_t{disk.f_bavail} * disk.f_frsize;
  }
};

}  // namespace

FileSystem& posix_file_system() {
  static PosixFileSystem instance;
  return instance;
}

}  // namespace pounce
