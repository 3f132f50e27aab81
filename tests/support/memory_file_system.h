// SPDX-License-Identifier: Apache-2.0
//
// A file system that lives in memory. Files grow in pieces that never move, so that a large one is
// not copied while it grows. Folders must be made before files are put into them, as on disk;
// scratch files need no folder.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <shared_mutex>
#include <system_error>
#include <utility>

#include "core/file.h"
#include "pounce/error.h"

namespace pounce::test {

/// What make_memory_file_system() is made of.
namespace memory_files {

constexpr std::size_t kPieceBytes = 64u << 10;

[[noreturn]] inline void fail(const std::string& path, const char* what, int code) {
  throw Error(ErrorKind::storage,
              fmt::format("{}: cannot {}: {}", path, what, std::generic_category().message(code)));
}

/// The bytes of one file; shared by its name, its writer and its readers. Thread-safe.
class Contents {
 public:
  explicit Contents(std::string path) : path_(std::move(path)) { touch(); }

  std::uint64_t size_bytes() const {
    const std::shared_lock lock(mutex_);
    return size_;
  }

  FileStatus status() const {
    const std::shared_lock lock(mutex_);
    FileStatus status;
    status.size_bytes = std::max(size_, reserved_);
    status.modified_ns = status.changed_ns = modified_ns_;
    status.inode = reinterpret_cast<std::uintptr_t>(this);
    return status;
  }
  void touch() {
    const std::unique_lock lock(mutex_);
    modified_ns_ = std::chrono::duration_cast<std::chrono::nanoseconds>(
                       std::chrono::system_clock::now().time_since_epoch())
                       .count();
  }
  /// Shows the file this long; only what was appended can be read.
  void reserve(std::uint64_t size_bytes) {
    const std::unique_lock lock(mutex_);
    reserved_ = size_bytes;
  }
  void hold() { ++holders_; }
  void let_go() { --holders_; }
  bool held() const { return holders_ > 0; }

  void append(std::span<const std::byte> bytes) {
    const std::unique_lock lock(mutex_);
    while (!bytes.empty()) {
      const std::size_t within = static_cast<std::size_t>(size_ % kPieceBytes);
      if (within == 0) pieces_.push_back(std::make_unique<std::byte[]>(kPieceBytes));
      const std::size_t n = std::min(bytes.size(), kPieceBytes - within);
      std::memcpy(pieces_.back().get() + within, bytes.data(), n);
      bytes = bytes.subspan(n);
      size_ += n;
    }
  }

  void cut(std::uint64_t size_bytes) {
    const std::unique_lock lock(mutex_);
    size_ = std::min(size_, size_bytes);
    pieces_.resize((size_ + kPieceBytes - 1) / kPieceBytes);
  }

  void read(std::uint64_t offset, std::span<std::byte> out) const {
    const std::shared_lock lock(mutex_);
    if (offset > size_ || out.size() > size_ - offset) {
      throw Error(ErrorKind::storage,
                  fmt::format("{}: cannot read {} bytes at {}: the file ends at byte {}", path_,
                              out.size(), offset, size_));
    }
    while (!out.empty()) {
      const std::size_t within = static_cast<std::size_t>(offset % kPieceBytes);
      const std::size_t n = std::min(out.size(), kPieceBytes - within);
      std::memcpy(out.data(), pieces_[offset / kPieceBytes].get() + within, n);
      out = out.subspan(n);
      offset += n;
    }
  }

 private:
  const std::string path_;
  mutable std::shared_mutex mutex_;
  std::vector<std::unique_ptr<std::byte[]>> pieces_;
  std::uint64_t size_ = 0, reserved_ = 0;
  std::int64_t modified_ns_ = 0;
  std::atomic<int> holders_{0};
};

/// Holds a file for as long as it lives. Shared between a writer and its readers.
class Hold {
 public:
  explicit Hold(std::shared_ptr<Contents> contents) : contents_(std::move(contents)) {
    contents_->hold();
  }
  ~Hold() { contents_->let_go(); }
  Hold(const Hold&) = delete;
  Hold& operator=(const Hold&) = delete;

 private:
  std::shared_ptr<Contents> contents_;
};
using HoldPtr = std::shared_ptr<Hold>;

class MemoryReadFile final : public ReadFile {
 public:
  explicit MemoryReadFile(std::shared_ptr<const Contents> contents, HoldPtr hold = nullptr)
      : contents_(std::move(contents)), hold_(std::move(hold)) {}
  std::uint64_t size_bytes() const override { return contents_->size_bytes(); }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    contents_->read(offset, out);
  }

 private:
  std::shared_ptr<const Contents> contents_;
  HoldPtr hold_;
};

class MemoryWriteFile final : public WriteFile {
 public:
  explicit MemoryWriteFile(std::shared_ptr<Contents> contents, HoldPtr hold = nullptr)
      : contents_(std::move(contents)), hold_(std::move(hold)) {}
  void append(std::span<const std::byte> bytes) override { contents_->append(bytes); }
  std::uint64_t size_bytes() const override { return contents_->size_bytes(); }
  void sync() override {}
  std::unique_ptr<ReadFile> reader() const override {
    return std::make_unique<MemoryReadFile>(contents_, hold_);
  }

 private:
  std::shared_ptr<Contents> contents_;
  HoldPtr hold_;
};

/// What names lead to; shared with files that get or lose theirs while they are open.
struct Names {
  std::mutex mutex;  ///< guards the others
  std::map<std::string, std::shared_ptr<Contents>> files;
  std::set<std::string> folders;
};

class MemoryResumableFile final : public ResumableFile {
 public:
  MemoryResumableFile(std::shared_ptr<Contents> contents, std::shared_ptr<Names> names,
                      std::string path, bool named)
      : contents_(std::move(contents)),
        hold_(std::make_shared<Hold>(contents_)),
        names_(std::move(names)),
        path_(std::move(path)),
        named_(named) {}
  void append(std::span<const std::byte> bytes) override { contents_->append(bytes); }
  std::uint64_t size_bytes() const override { return contents_->size_bytes(); }
  void sync() override {}
  void flush() override {}
  void cut(std::uint64_t size_bytes) override { contents_->cut(size_bytes); }
  std::unique_ptr<ReadFile> reader() const override {
    return std::make_unique<MemoryReadFile>(contents_, hold_);
  }
  bool keep() override {
    const std::lock_guard lock(names_->mutex);
    named_ = named_ || names_->files.emplace(path_, contents_).second;
    return named_;
  }
  void forget() noexcept override {
    const std::lock_guard lock(names_->mutex);
    if (named_) names_->files.erase(path_);
    named_ = false;
  }

 private:
  const std::shared_ptr<Contents> contents_;
  const HoldPtr hold_;
  const std::shared_ptr<Names> names_;
  const std::string path_;
  bool named_;
};

/// The locks held; shared with them, so that a lock may outlive the file system.
struct HeldLocks {
  std::mutex mutex;
  std::set<std::string> paths;
};

class MemoryFileLock final : public FileLock {
 public:
  MemoryFileLock(std::shared_ptr<HeldLocks> held, std::string path)
      : held_(std::move(held)), path_(std::move(path)) {}
  ~MemoryFileLock() override {
    const std::lock_guard lock(held_->mutex);
    held_->paths.erase(path_);
  }

 private:
  std::shared_ptr<HeldLocks> held_;
  std::string path_;
};

class MemoryFileSystem final : public FileSystem {
 public:
  std::unique_ptr<ReadFile> open(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    const auto found = names_->files.find(normal(path));
    if (found == names_->files.end()) fail(path, "open", ENOENT);
    return std::make_unique<MemoryReadFile>(found->second);
  }

  std::unique_ptr<WriteFile> create(const std::string& path) override {
    return std::make_unique<MemoryWriteFile>(add(path));
  }

  std::unique_ptr<WriteFile> create_scratch(const std::string& folder) override {
    return std::make_unique<MemoryWriteFile>(
        std::make_shared<Contents>(folder + "/(scratch file)"));
  }

  std::unique_ptr<ResumableFile> create_resumable(const std::string& path) override {
    return std::make_unique<MemoryResumableFile>(std::make_shared<Contents>(path), names_,
                                                 normal(path), false);
  }
  std::unique_ptr<ResumableFile> reopen_resumable(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    const auto found = names_->files.find(normal(path));
    if (found == names_->files.end() || found->second->held()) return nullptr;
    return std::make_unique<MemoryResumableFile>(found->second, names_, normal(path), true);
  }

  bool exists(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    return names_->files.contains(normal(path)) || has_folder(normal(path));
  }

  void rename(const std::string& from, const std::string& to) override {
    const std::lock_guard lock(names_->mutex);
    const auto found = names_->files.find(normal(from));
    if (found == names_->files.end() || !has_folder(parent(normal(to))))
      fail(from, "rename", ENOENT);
    auto contents = std::move(found->second);
    names_->files.erase(found);
    names_->files[normal(to)] = std::move(contents);
  }

  void remove(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    names_->files.erase(normal(path));
  }

  void make_folders(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    for (std::string name = normal(path); !has_folder(name); name = parent(name)) {
      if (names_->files.contains(name)) fail(path, "create the folder", ENOTDIR);
      names_->folders.insert(name);
    }
  }

  void sync_folder(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    if (!has_folder(normal(path))) fail(path, "open the folder", ENOENT);
  }

  std::vector<std::string> list(const std::string& folder) override {
    const std::lock_guard lock(names_->mutex);
    const std::string name = normal(folder);
    if (!has_folder(name)) fail(folder, "list the folder", ENOENT);
    std::set<std::string> names;
    for (const auto& [path, contents] : names_->files) {
      if (parent(path) == name) names.insert(std::filesystem::path(path).filename().string());
    }
    for (const std::string& path : names_->folders) {
      if (parent(path) == name) names.insert(std::filesystem::path(path).filename().string());
    }
    return {names.begin(), names.end()};
  }

  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    const std::lock_guard lock(held_->mutex);
    if (!held_->paths.insert(normal(path)).second) return nullptr;
    return std::make_unique<MemoryFileLock>(held_, normal(path));
  }

  std::unique_ptr<ReadFile> open_held(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    const auto found = names_->files.find(normal(path));
    if (found == names_->files.end()) return nullptr;
    return std::make_unique<MemoryReadFile>(found->second, std::make_shared<Hold>(found->second));
  }

  std::unique_ptr<WriteFile> create_held(const std::string& path) override {
    if (exists(path)) return nullptr;
    const auto contents = add(path);
    return std::make_unique<MemoryWriteFile>(contents, std::make_shared<Hold>(contents));
  }

  std::unique_ptr<ReadFile> open_private(const std::string& path) override {
    return open_held(path);
  }
  std::unique_ptr<WriteFile> create_private(const std::string& path) override {
    return create_held(path);
  }

  bool remove_unheld(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    const auto found = names_->files.find(normal(path));
    if (found == names_->files.end()) return true;
    if (found->second->held()) return false;
    names_->files.erase(found);
    return true;
  }

  bool rename_new(const std::string& from, const std::string& to) override {
    if (exists(to)) return false;
    rename(from, to);
    return true;
  }

  std::optional<FileStatus> status(const std::string& path) override {
    const std::lock_guard lock(names_->mutex);
    if (const auto found = names_->files.find(normal(path)); found != names_->files.end()) {
      return found->second->status();
    }
    if (!has_folder(normal(path))) return std::nullopt;
    FileStatus status;
    status.is_folder = true;
    return status;
  }

  void touch(const std::string& path) override { get(path, "set its time")->touch(); }
  void resize(const std::string& path, std::uint64_t size_bytes) override {
    get(path, "set its size")->reserve(size_bytes);
  }
  bool is_writable(const std::string& folder) override {
    const std::lock_guard lock(names_->mutex);
    return has_folder(normal(folder));
  }
  std::uint64_t disk_bytes(const std::string&) override { return 0; }
  std::uint64_t free_bytes(const std::string&) override { return UINT64_MAX; }

 private:
  std::shared_ptr<Contents> add(const std::string& path) {
    const std::lock_guard lock(names_->mutex);
    const std::string name = normal(path);
    if (!has_folder(parent(name))) fail(path, "create", ENOENT);
    if (names_->files.contains(name) || names_->folders.contains(name))
      fail(path, "create", EEXIST);
    return names_->files[name] = std::make_shared<Contents>(path);
  }
  std::shared_ptr<Contents> get(const std::string& path, const char* what) {
    const std::lock_guard lock(names_->mutex);
    const auto found = names_->files.find(normal(path));
    if (found == names_->files.end()) fail(path, what, ENOENT);
    return found->second;
  }

  static std::string normal(const std::string& path) {
    std::string name = std::filesystem::path(path).lexically_normal().string();
    if (name.size() > 1 && name.back() == '/') name.pop_back();
    return name;
  }
  static std::string parent(const std::string& name) {
    return std::filesystem::path(name).parent_path().string();
  }
  bool has_folder(const std::string& name) const {
    return name.empty() || name == "." || name == "/" || names_->folders.contains(name);
  }

  const std::shared_ptr<Names> names_ = std::make_shared<Names>();
  std::shared_ptr<HeldLocks> held_ = std::make_shared<HeldLocks>();
};

}  // namespace memory_files

/// Keeps everything in memory.
inline std::unique_ptr<FileSystem> make_memory_file_system() {
  return std::make_unique<memory_files::MemoryFileSystem>();
}

}  // namespace pounce::test
