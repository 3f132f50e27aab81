// SPDX-License-Identifier: Apache-2.0
//
// Scratch files that outlive a process that dies.
//
// A file begins without a name and most never get one: a job of a second leaves nothing, however it
// ends. Where a file system has no nameless files (NFS, FAT) it has its name from the start.
//
// The exclusive lock says that somebody is at work on it. It is taken before there is a name, and
// goes with the process: whoever gets it next knows that its owner is dead, and goes on with it.
// What it says is believed only if nobody else could have written it.
#include "core/resumable_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <utility>

#include "core/growing_file.h"
#include "core/posix_io.h"
#include "pounce/error.h"

namespace pounce {
namespace {

/// False also where there are no locks: then nobody can tell whether its owner lives.
bool is_alone(int fd) {
  while (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EINTR) return false;
  }
  return true;
}

class PosixResumableFile final : public ResumableFile {
 public:
  PosixResumableFile(std::shared_ptr<GrowingFile> file, std::string path, bool named)
      : file_(std::move(file)), path_(std::move(path)), named_(named) {}

  void append(std::span<const std::byte> bytes) override { file_->append(bytes); }
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void sync() override { file_->sync(); }
  std::unique_ptr<ReadFile> reader() const override {
    file_->drop_buffer();
    return std::make_unique<GrowingReadFile>(file_);
  }
  void flush() override { file_->flush(); }
  void cut(std::uint64_t size_bytes) override { file_->cut(size_bytes); }

  bool keep() override {
    if (named_) return true;
    const std::string self = fmt::format("/proc/self/fd/{}", file_->descriptor());
    named_ = ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, path_.c_str(), AT_SYMLINK_FOLLOW) == 0;
    return named_;
  }

  void forget() noexcept override {
    if (named_) ::unlink(path_.c_str());
    named_ = false;
  }

 private:
  const std::shared_ptr<GrowingFile> file_;
  const std::string path_;
  bool named_;
};

}  // namespace

std::unique_ptr<ResumableFile> create_resumable(const std::string& path,
                                                std::shared_ptr<ScratchAccount> account) {
  const std::string parent = std::filesystem::path(path).parent_path().string();
  const std::string folder = parent.empty() ? "." : parent;
  bool named = false;
  // Without O_EXCL, which would forbid a name.
  int fd = ::access("/proc/self/fd", X_OK) == 0 ? open_retrying(folder, O_TMPFILE | O_RDWR, 0600)
                                                : (errno = EOPNOTSUPP, -1);
  if (fd < 0 && (errno == EOPNOTSUPP || errno == EISDIR || errno == EINVAL)) {
    fd = open_retrying(path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW, 0600);
    named = fd >= 0;
    if (fd < 0 && errno == EEXIST) return nullptr;
  }
  if (fd < 0) fail_to_change(folder, "create a scratch file there", errno);
  Descriptor file(fd);
  if (!is_alone(file.get())) {
    if (named) ::unlink(path.c_str());
    return nullptr;
  }
  return std::make_unique<PosixResumableFile>(
      std::make_shared<GrowingFile>(std::move(file), folder + "/(scratch file)",
                                    std::move(account)),
      path, named);
}

std::unique_ptr<ResumableFile> reopen_resumable(const std::string& path,
                                                std::shared_ptr<ScratchAccount> account) {
  Descriptor file(open_retrying(path, O_RDWR | O_NOFOLLOW | O_NONBLOCK));
  if (file.get() < 0) return nullptr;
  const struct stat found = status_of(file.get(), path);
  const bool is_ours = S_ISREG(found.st_mode) && found.st_uid == ::geteuid() &&
                       found.st_nlink == 1 && (found.st_mode & (S_IWGRP | S_IWOTH)) == 0;
  if (!is_ours || !is_alone(file.get()) || !is_named(file.get(), path)) return nullptr;
  auto growing = std::make_shared<GrowingFile>(std::move(file), path, std::move(account));
  growing->go_on();
  return std::make_unique<PosixResumableFile>(std::move(growing), path, true);
}

}  // namespace pounce
