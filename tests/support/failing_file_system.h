// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/file.h"
#include "pounce/error.h"

namespace pounce::test {

/// How a FailingFileSystem fails.
struct FailurePlan {
  std::uint64_t fail_at = 0;  ///< number of the call that fails, from 1; 0 = none
  bool from_then_on = false;  ///< every later call fails too (a full disk)
  bool short_writes = false;  ///< a failing append first writes half of its bytes
};

/// Passes everything on to another file system and makes chosen calls throw Error(storage). Every
/// call of FileSystem, WriteFile and ReadFile that could fail on a real disk counts. Thread-safe;
/// must outlive the files it made.
class FailingFileSystem : public FileSystem {
 public:
  explicit FailingFileSystem(FileSystem& real, FailurePlan plan = {}) : real_(real), plan_(plan) {}

  std::uint64_t calls() const { return calls_; }
  /// Starts counting again, with another plan.
  void restart(FailurePlan plan) {
    plan_ = plan;
    calls_ = 0;
  }

  std::unique_ptr<ReadFile> open(const std::string& path) override {
    step("open");
    return std::make_unique<Reader>(*this, real_.open(path));
  }
  std::unique_ptr<WriteFile> create(const std::string& path) override {
    step("create");
    return std::make_unique<Writer>(*this, real_.create(path));
  }
  std::unique_ptr<WriteFile> create_scratch(const std::string& folder) override {
    step("create_scratch");
    return std::make_unique<Writer>(*this, real_.create_scratch(folder));
  }
  std::unique_ptr<ResumableFile> create_resumable(const std::string& path) override {
    step("create_resumable");
    auto file = real_.create_resumable(path);
    return file ? std::make_unique<Resumable>(*this, std::move(file)) : nullptr;
  }
  std::unique_ptr<ResumableFile> reopen_resumable(const std::string& path) override {
    step("reopen_resumable");
    auto file = real_.reopen_resumable(path);
    return file ? std::make_unique<Resumable>(*this, std::move(file)) : nullptr;
  }
  bool exists(const std::string& path) override {
    step("exists");
    return real_.exists(path);
  }
  void rename(const std::string& from, const std::string& to) override {
    step("rename");
    real_.rename(from, to);
  }
  void remove(const std::string& path) override {
    step("remove");
    real_.remove(path);
  }
  void make_folders(const std::string& path) override {
    step("make_folders");
    real_.make_folders(path);
  }
  void sync_folder(const std::string& path) override {
    step("sync_folder");
    real_.sync_folder(path);
  }
  std::vector<std::string> list(const std::string& folder) override {
    step("list");
    return real_.list(folder);
  }
  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    step("try_lock");
    return real_.try_lock(path);
  }
  std::unique_ptr<ReadFile> open_held(const std::string& path) override {
    step("open_held");
    auto file = real_.open_held(path);
    return file ? std::make_unique<Reader>(*this, std::move(file)) : nullptr;
  }
  std::unique_ptr<WriteFile> create_held(const std::string& path) override {
    step("create_held");
    auto file = real_.create_held(path);
    return file ? std::make_unique<Writer>(*this, std::move(file)) : nullptr;
  }
  std::unique_ptr<ReadFile> open_private(const std::string& path) override {
    step("open_private");
    auto file = real_.open_private(path);
    return file ? std::make_unique<Reader>(*this, std::move(file)) : nullptr;
  }
  std::unique_ptr<WriteFile> create_private(const std::string& path) override {
    step("create_private");
    auto file = real_.create_private(path);
    return file ? std::make_unique<Writer>(*this, std::move(file)) : nullptr;
  }
  bool remove_unheld(const std::string& path) override {
    step("remove_unheld");
    return real_.remove_unheld(path);
  }
  bool rename_new(const std::string& from, const std::string& to) override {
    step("rename_new");
    return real_.rename_new(from, to);
  }
  std::optional<FileStatus> status(const std::string& path) override {
    step("status");
    return real_.status(path);
  }
  void touch(const std::string& path) override {
    step("touch");
    real_.touch(path);
  }
  void resize(const std::string& path, std::uint64_t size_bytes) override {
    step("resize");
    real_.resize(path, size_bytes);
  }
  bool lets_all_write(const std::string& path, const std::string& folder) override {
    return real_.lets_all_write(path, folder);
  }
  bool is_writable(const std::string& folder) override { return real_.is_writable(folder); }
  std::uint64_t disk_bytes(const std::string& folder) override { return real_.disk_bytes(folder); }
  std::uint64_t free_bytes(const std::string& folder) override { return real_.free_bytes(folder); }

 private:
  /// Counts a call; true if it is to fail.
  bool fails() {
    const std::uint64_t call = ++calls_;
    return plan_.fail_at != 0 &&
           (call == plan_.fail_at || (plan_.from_then_on && call > plan_.fail_at));
  }
  [[noreturn]] static void fail(const char* what) {
    throw Error(ErrorKind::storage, std::string("injected failure of ") + what);
  }
  void step(const char* what) {
    if (fails()) fail(what);
  }

  class Reader final : public ReadFile {
   public:
    Reader(FailingFileSystem& files, std::unique_ptr<ReadFile> real)
        : files_(files), real_(std::move(real)) {}
    std::uint64_t size_bytes() const override { return real_->size_bytes(); }
    void read(std::uint64_t offset, std::span<std::byte> out) const override {
      files_.step("read");
      real_->read(offset, out);
    }

   private:
    FailingFileSystem& files_;
    std::unique_ptr<ReadFile> real_;
  };

  /// Of any kind of file that is appended to.
  template <class File>
  class Appending : public File {
   public:
    Appending(FailingFileSystem& files, std::unique_ptr<File> real)
        : files_(files), real_(std::move(real)) {}
    void append(std::span<const std::byte> bytes) override {
      if (files_.fails()) {
        if (files_.plan_.short_writes) real_->append(bytes.first(bytes.size() / 2));
        fail("append");
      }
      real_->append(bytes);
    }
    std::uint64_t size_bytes() const override { return real_->size_bytes(); }
    void sync() override {
      files_.step("sync");
      real_->sync();
    }
    std::unique_ptr<ReadFile> reader() const override {
      files_.step("reader");
      return std::make_unique<Reader>(files_, real_->reader());
    }

   protected:
    FailingFileSystem& files_;
    std::unique_ptr<File> real_;
  };
  using Writer = Appending<WriteFile>;

  class Resumable final : public Appending<ResumableFile> {
   public:
    using Appending::Appending;
    void flush() override {
      files_.step("flush");
      real_->flush();
    }
    void cut(std::uint64_t size_bytes) override {
      files_.step("cut");
      real_->cut(size_bytes);
    }
    bool keep() override { return real_->keep(); }
    void forget() noexcept override { real_->forget(); }
  };

  FileSystem& real_;
  FailurePlan plan_;
  std::atomic<std::uint64_t> calls_{0};
};

}  // namespace pounce::test
