// SPDX-License-Identifier: Apache-2.0
//
// System calls on files, as core/file.cpp and the readers and writers of foreign files use them:
// retried where a signal interrupts them, and what they refuse said in a sentence.
#pragma once

#include <dirent.h>
#include <sys/stat.h>
#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>

namespace pounce {

/// An errno for which trying again may help: see Error::is_passing().
bool is_passing(int code) noexcept;

/// What to do about an errno of a file or folder, as the end of a sentence: "; free some space or
/// choose another folder". "" where its message says it all.
const char* storage_advice(int code);

/// Throws Error(storage): "PATH: cannot WHAT: reason", and what to do about it.
[[noreturn]] void fail_storage(const std::string& path, const std::string& what, int code);
/// The same where something should have been written or removed: there a refusal has a cure.
[[noreturn]] void fail_to_change(const std::string& path, const std::string& what, int code);

/// A file descriptor that is closed with this object.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

struct CloseFolder {
  void operator()(DIR* folder) const { ::closedir(folder); }
};
using FolderStream = std::unique_ptr<DIR, CloseFolder>;

/// open() that goes on after a signal; -1 and errno if it fails.
int open_retrying(const std::string& path, int flags, mode_t mode = 0);

/// fsync() that goes on after a signal; false and errno if it fails.
bool sync_retrying(int fd);

/// Opens `path` for reading and never waits: not for somebody who writes into a pipe, not for a
/// device. -1, and errno, if that fails. What was opened may be anything: ask fstat() before
/// reading.
int open_for_reading(const std::string& path);

/// Opens a nameless file in `folder` for reading and writing; -1 and errno if that cannot be. Where
/// a file system has no nameless files it has a name for a moment; what a process left that died at
/// that moment is removed. Thread-safe.
int open_scratch_file(const std::string& folder);

/// Takes a lock (LOCK_SH or LOCK_EX) without waiting; false if somebody else has it.
bool lock_now(int fd, const std::string& path, int kind);
/// Whether `path` names the open file: another process may have removed or replaced it.
bool is_named(int fd, const std::string& path);

/// fstat() that throws; `path` is for the message.
struct stat status_of(int fd, const std::string& path);

/// "a folder", "a pipe", "a device", "a socket": what a file that is no regular one is, for
/// messages.
const char* kind_of_file(mode_t mode);

/// All of it, or Error(storage); `path` is for the message.
void read_fully(int fd, const std::string& path, std::uint64_t offset, std::span<std::byte> out);
void write_fully(int fd, const std::string& path, std::uint64_t offset,
                 std::span<const std::byte> bytes);

}  // namespace pounce
