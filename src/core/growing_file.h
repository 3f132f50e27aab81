// SPDX-License-Identifier: Apache-2.0
//
// A file that is written from its start to its end while others read what it has so far.
#pragma once

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/file.h"
#include "core/posix_io.h"

namespace pounce {

// Chunks are 1 KB to 1 MB: small ones are gathered so that a write costs no more than the copy.
inline constexpr std::size_t kWriteBufferBytes = 256u << 10;

/// What a growing file and its readers share. Bytes below written_ are in the file, the rest in the
/// buffer. A failed write changes neither, so that it may be tried again. Its bytes are in the
/// account, if there is one, until nobody has it open.
class GrowingFile {
 public:
  GrowingFile(Descriptor fd, std::string path, std::shared_ptr<ScratchAccount> account)
      : fd_(std::move(fd)), path_(std::move(path)), account_(std::move(account)) {}
  ~GrowingFile() {
    if (account_) account_->give_back(taken_);
  }
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;

  void append(std::span<const std::byte> bytes) {
    const std::lock_guard lock(mutex_);
    if (account_) {
      account_->take(bytes.size());
      taken_ += bytes.size();
    }
    // Order in the file is order of appends, so what is buffered goes first.
    if (buffer_.size() + bytes.size() > kWriteBufferBytes) flush_locked();
    if (bytes.size() >= kWriteBufferBytes) {  // no copy of what is large already
      const std::uint64_t at = written_.load(std::memory_order_relaxed);
      write_fully(fd_.get(), path_, at, bytes);
      // Released after the bytes are in the file: a reader that sees the new count may read up to
      // it.
      written_.store(at + bytes.size(), std::memory_order_release);
    } else {
      if (buffer_.capacity() == 0) buffer_.reserve(kWriteBufferBytes);
      buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    }
  }

  /// Goes on behind what is in the file already.
  void go_on() {
    const auto size = static_cast<std::uint64_t>(status_of(fd_.get(), path_).st_size);
    if (account_) account_->adopt(size);
    taken_ = account_ ? size : 0;
    written_ = size;
  }

  /// Drops what is behind this.
  void cut(std::uint64_t size_bytes) {
    const std::lock_guard lock(mutex_);
    flush_locked();
    while (::ftruncate(fd_.get(), static_cast<off_t>(size_bytes)) != 0) {
      if (errno != EINTR) fail_to_change(path_, "set its size", errno);
    }
    const std::uint64_t dropped = written_ - size_bytes;
    written_ = size_bytes;
    if (!account_) return;
    account_->give_back(dropped);
    taken_ -= dropped;
  }

  std::uint64_t size_bytes() const {
    const std::lock_guard lock(mutex_);
    return written_.load(std::memory_order_relaxed) + buffer_.size();
  }

  int descriptor() const { return fd_.get(); }

  /// Empties the buffer: the bytes outlive this process.
  void flush() {
    const std::lock_guard lock(mutex_);
    flush_locked();
  }
  /// And gives its memory back: files that are only read from now on hold none.
  void drop_buffer() {
    const std::lock_guard lock(mutex_);
    flush_locked();
    std::vector<std::byte>().swap(buffer_);
  }

  void sync() {
    // The data alone: a size that grew counts as data, times do not matter.
    drop_buffer();
    // After a failed fdatasync the kernel may have dropped the pages and report success next time.
    if (sync_failed_) fail_storage(path_, "write to the disk", EIO);
    while (::fdatasync(fd_.get()) != 0) {
      if (errno == EINTR) continue;
      sync_failed_ = true;
      fail_storage(path_, "write to the disk", errno);
    }
  }

  void read(std::uint64_t offset, std::span<std::byte> out) {
    // Mostly no lock: what was flushed never changes.
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
  const std::shared_ptr<ScratchAccount> account_;
  mutable std::mutex mutex_;  // guards buffer_, taken_ and changes of written_
  std::uint64_t taken_ = 0;   // from the account
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

}  // namespace pounce
