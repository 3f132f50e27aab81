// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace pounce {

/// A file open for reading at any place. read() is thread-safe (pread).
class ReadFile {
 public:
  virtual ~ReadFile() = default;
  virtual std::uint64_t size_bytes() const = 0;
  /// Fills `out` from `offset`. Throws Error(storage) with path and reason, also at end of file.
  virtual void read(std::uint64_t offset, std::span<std::byte> out) const = 0;
};

/// A file being written from its start to its end. Not thread-safe, but readers of what was
/// appended may work in other threads meanwhile. Appends go through a small buffer: nothing is sure
/// to be on disk before sync(), and what was appended after the last sync() may be lost when the
/// object goes.
class WriteFile {
 public:
  virtual ~WriteFile() = default;
  virtual void append(std::span<const std::byte> bytes) = 0;
  virtual std::uint64_t size_bytes() const = 0;
  virtual void sync() = 0;  ///< fdatasync; once it failed it fails for good
  /// The same file for reading what was appended so far (scratch files are read while they grow).
  virtual std::unique_ptr<ReadFile> reader() const = 0;
};

/// A scratch file that another process can go on with when this one has died: nameless until keep()
/// gives it its name. Nobody else can have it while it is open. Not thread-safe, but for readers.
class ResumableFile : public WriteFile {
 public:
  /// Gives it its name. False, and it stays nameless, where that cannot be: there is another file
  /// of that name, or the folder is gone.
  virtual bool keep() = 0;
  /// What was appended so far outlives this process. (Whether it outlives the machine sync() says.)
  virtual void flush() = 0;
  /// Drops what is behind this.
  virtual void cut(std::uint64_t size_bytes) = 0;
  /// Takes its name away: it goes when it is closed.
  virtual void forget() noexcept = 0;
};

/// What a file system says of one name.
struct FileStatus {
  std::uint64_t size_bytes = 0;
  std::int64_t modified_ns = 0;  ///< since 1970; what touch() sets
  std::int64_t changed_ns = 0;   ///< since 1970; no program can set it
  std::uint64_t device = 0, inode = 0;
  bool is_folder = false;
};

/// Is it the same file, and has nobody written to it, as far as its file system says?
inline bool is_unchanged(const FileStatus& before, const FileStatus& now) {
  return before.device == now.device && before.inode == now.inode &&
         before.size_bytes == now.size_bytes && before.modified_ns == now.modified_ns &&
         before.changed_ns == now.changed_ns;
}

/// A lock on a path. Released when destroyed or when the process dies, however it dies.
class FileLock {
 public:
  virtual ~FileLock() = default;
  /// Has nobody else had it since this process had it last? False where nobody knows.
  virtual bool was_ours() const { return false; }
};

/// Every access to files of our own goes through here (foreign image and mesh libraries excepted),
/// so that a test can make the n-th call fail and an in-core run needs no disk. Every function
/// throws Error(storage) naming path and reason.
class FileSystem {
 public:
  virtual ~FileSystem() = default;
  virtual std::unique_ptr<ReadFile> open(const std::string& path) = 0;
  virtual std::unique_ptr<WriteFile> create(const std::string& path) = 0;  ///< fails if it exists
  /// A nameless file in `folder`: gone when closed or when the process dies, however it dies.
  virtual std::unique_ptr<WriteFile> create_scratch(const std::string& folder) = 0;
  /// Null where this file system has no such files.
  virtual std::unique_ptr<ResumableFile> create_resumable(const std::string& path) = 0;
  /// One that was kept, at its end. Null if there is none, somebody has it, or another user could
  /// have written it; a symbolic link is none.
  virtual std::unique_ptr<ResumableFile> reopen_resumable(const std::string& path) = 0;
  virtual bool exists(const std::string& path) = 0;
  virtual void rename(const std::string& from, const std::string& to) = 0;  ///< replaces `to`
  virtual void remove(const std::string& path) = 0;                         ///< missing is fine
  virtual void make_folders(const std::string& path) = 0;
  virtual void sync_folder(const std::string& path) = 0;
  virtual std::vector<std::string> list(const std::string& folder) = 0;  ///< names, sorted
  /// Takes the lock on `path` (a file that is created, gets the number of this process as text, and
  /// stays until its holder removes it); null if somebody else holds it, be it another process or
  /// another object of this one.
  virtual std::unique_ptr<FileLock> try_lock(const std::string& path) = 0;

  // Files that several processes share. Whoever has one open through these holds it (a shared
  // lock); whoever removes one through remove_unheld() is sure that nobody does. None of
  // them follows a symbolic link: in a folder that users share it may lead anywhere.

  /// Like open(), and holds the file until the reader is gone; null if there is none, it is just
  /// being removed, or it is no regular file.
  virtual std::unique_ptr<ReadFile> open_held(const std::string& path) = 0;
  /// Like create(), and holds the file until writer and readers are gone. Null if there is one of
  /// that name, or it was taken for a leftover and removed before it could be held; try another.
  virtual std::unique_ptr<WriteFile> create_held(const std::string& path) = 0;
  /// Like open(), but null unless the file is this user's own and nobody else may write to it.
  virtual std::unique_ptr<ReadFile> open_private(const std::string& path) = 0;
  /// Like create_held(), and no other user may read or write it.
  virtual std::unique_ptr<WriteFile> create_private(const std::string& path) = 0;
  /// Removes a file unless somebody holds or locks it (then false). A missing one is fine.
  virtual bool remove_unheld(const std::string& path) = 0;
  /// Like rename(), but false, and nothing done, if `to` exists.
  virtual bool rename_new(const std::string& from, const std::string& to) = 0;
  /// Nothing if there is no such file.
  virtual std::optional<FileStatus> status(const std::string& path) = 0;
  /// Sets modified_ns to now. The file must exist.
  virtual void touch(const std::string& path) = 0;
  /// Makes a file this long, whatever was appended to it; what is added takes no room yet.
  virtual void resize(const std::string& path, std::uint64_t size_bytes) = 0;
  /// Whether files can be made in this folder.
  virtual bool is_writable(const std::string& folder) = 0;
  /// May whoever may make files in this folder write to the file at `path`, too, as their modes
  /// say? False where lists of access might say otherwise.
  virtual bool lets_all_write(const std::string& /*path*/, const std::string& /*folder*/) {
    return false;
  }
  /// Size of the file system that holds the folder; 0 = it has none.
  virtual std::uint64_t disk_bytes(const std::string& folder) = 0;
  /// Room that files of this user may still take there; UINT64_MAX = nobody knows.
  virtual std::uint64_t free_bytes(const std::string& folder) = 0;
};

/// Files of the system, by pread() and pwrite().
FileSystem& posix_file_system();

/// Who has FileSystem::try_lock()'s lock on this file, for messages: "process 123", or "another
/// process" where the file does not say.
std::string lock_holder(FileSystem& files, const std::string& lock_path);

/// What the scratch files of a job take together, to the byte. Thread-safe, if `refusal` is.
class ScratchAccount {
 public:
  /// What would take more than `limit_bytes` (0 = any) throws Error(storage) with what `refusal`
  /// says. `is_usual`: that is the default_scratch_limit().
  ScratchAccount(std::uint64_t limit_bytes, std::function<std::string()> refusal,
                 bool is_usual = false)
      : limit_(limit_bytes), refusal_(std::move(refusal)), is_usual_(is_usual) {}

  void take(std::uint64_t bytes);
  /// Counts what an earlier run has left on the disk, even if that is too much. To the usual limit
  /// it is room that is free.
  void adopt(std::uint64_t bytes) noexcept;
  bool is_over() const { return limit_ != 0 && used_ > limit_; }
  void give_back(std::uint64_t bytes) noexcept { used_ -= bytes; }
  /// The most at one moment.
  std::uint64_t peak_bytes() const { return peak_; }

 private:
  void note_peak(std::uint64_t used) noexcept;

  std::atomic<std::uint64_t> limit_;
  const std::function<std::string()> refusal_;
  const bool is_usual_;
  std::atomic<std::uint64_t> used_{0}, peak_{0};
};

/// As posix_file_system(), and its scratch files are counted in `account`: each until its writer
/// and its readers are gone.
std::unique_ptr<FileSystem> make_counting_file_system(std::shared_ptr<ScratchAccount> account);

/// What scratch files may take together when nobody says: a tenth of the room that is free in
/// `folder`, but 1 GiB at least; 0 = no limit, where nobody knows the room.
std::uint64_t default_scratch_limit(FileSystem& files, const std::string& folder);

/// Where scratch files are made.
struct ScratchFolder {
  FileSystem* files = nullptr;
  std::string path;
  std::unique_ptr<WriteFile> create() const { return files->create_scratch(path); }
};

}  // namespace pounce
