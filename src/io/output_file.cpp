// SPDX-License-Identifier: Apache-2.0
#include "io/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "pounce/error.h"

// The file has no name while it is being written (O_TMPFILE), so that even a killed process leaves
// nothing behind. It gets a hidden name beside its final one only to be renamed over it: linkat()
// cannot replace.
namespace pounce::io {
namespace {

std::string folder_of(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path().string() : ".";
}

}  // namespace

OutputFile::OutputFile(const std::string& path)
    : path_(path), folder_(folder_of(path)), folders_(folder_) {
  const std::filesystem::path whole(path);
  struct stat status {};
  if (::stat(folder_.c_str(), &status) != 0)
    fail(fmt::format("{}: {}", folder_, std::strerror(errno)));
  if (!S_ISDIR(status.st_mode)) fail(fmt::format("{} is not a folder", folder_));
  if (::stat(path_.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
    fail("there is something of that name that is not a file");
  }
  static std::atomic<unsigned> counter{0};
  temporary_ = (std::filesystem::path(folder_) /
                fmt::format(".{}.{}-{}.tmp", whole.filename().string(), ::getpid(), counter++))
                   .string();
  if (::access("/proc/self/fd", X_OK) == 0) {
    descriptor_ = ::open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666);
    nameless_ = descriptor_ >= 0;
  }
  if (descriptor_ < 0) {
    ::unlink(temporary_.c_str());  // of a dead process that had our number
    descriptor_ = ::open(temporary_.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0666);
    if (descriptor_ < 0) fail(std::strerror(errno));
    has_temporary_ = true;
  }
  stream_ = ::fopencookie(this, "w", {nullptr, write_piece, seek, nullptr});
  if (stream_ == nullptr) {
    ::close(descriptor_);
    if (has_temporary_) ::unlink(temporary_.c_str());
    fail("no stream");
  }
  std::setvbuf(stream_, nullptr, _IOFBF, 256 << 10);
}

OutputFile::~OutputFile() {
  if (stream_ != nullptr) std::fclose(stream_);
  if (descriptor_ >= 0) ::close(descriptor_);
  if (has_temporary_) ::unlink(temporary_.c_str());
}

long OutputFile::write_piece(void* opaque, const char* bytes, std::size_t count) {
  auto& self = *static_cast<OutputFile*>(opaque);
  // A failure is kept for check() and never shown to the encoder: libjpeg ends the process on one.
  for (std::size_t done = 0; done < count && self.failure_ == 0;) {
    const ssize_t put =
        ::pwrite(self.descriptor_, bytes + done, count - done,
                 static_cast<off_t>(self.position_ + static_cast<std::int64_t>(done)));
    if (put > 0) {
      done += static_cast<std::size_t>(put);
    } else if (put == 0 || errno != EINTR) {
      self.failure_ = put == 0 ? EIO : errno;
    }
  }
  self.position_ += static_cast<std::int64_t>(count);
  return static_cast<long>(count);
}

int OutputFile::seek(void* opaque, std::int64_t* offset, int whence) {
  auto& self = *static_cast<OutputFile*>(opaque);
  std::int64_t base = 0;
  if (whence == SEEK_CUR) base = self.position_;
  if (whence == SEEK_END) base = ::lseek(self.descriptor_, 0, SEEK_END);
  if (base + *offset < 0) {
    errno = EINVAL;
    return -1;
  }
  self.position_ = *offset = base + *offset;
  return 0;
}

std::uint64_t OutputFile::size_bytes() {
  std::fflush(stream_);
  struct stat status {};
  return ::fstat(descriptor_, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

std::size_t OutputFile::read_back(std::int64_t offset, void* out, std::size_t count) noexcept {
  std::fflush(stream_);
  const ssize_t got = ::pread(descriptor_, out, count, static_cast<off_t>(offset));
  return got < 0 ? 0 : static_cast<std::size_t>(got);
}

void OutputFile::check() const {
  if (failure_ != 0) fail(std::strerror(failure_));
}

void OutputFile::commit() {
  FILE* const stream = stream_;
  stream_ = nullptr;
  const bool flushed = std::fclose(stream) == 0;
  check();
  if (!flushed || ::fsync(descriptor_) != 0) fail(std::strerror(errno));
  if (nameless_) {
    ::unlink(temporary_.c_str());
    const std::string self = fmt::format("/proc/self/fd/{}", descriptor_);
    if (::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, temporary_.c_str(), AT_SYMLINK_FOLLOW) != 0) {
      fail(std::strerror(errno));
    }
    has_temporary_ = true;
  }
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) fail(std::strerror(errno));
  has_temporary_ = false;
  const int folder = ::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool synced = folder >= 0 && ::fsync(folder) == 0;
  const int reason = errno;
  if (folder >= 0) ::close(folder);
  // Some network file systems cannot sync a folder; the file itself is safe.
  if (!synced && reason != EINVAL && reason != EACCES) fail(std::strerror(reason));
}

void OutputFile::fail(const std::string& what) const {
  throw Error(ErrorKind::storage, fmt::format("cannot write {}: {}", path_, what));
}

}  // namespace pounce::io
