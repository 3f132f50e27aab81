// SPDX-License-Identifier: Apache-2.0
#include "core/scratch_limit.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <utility>

#include "pounce/error.h"

namespace pounce {
namespace {

/// What all scratch files of one job take.
class Allowance {
 public:
  Allowance(std::uint64_t limit_bytes, std::function<std::string()> refusal)
      : limit_(limit_bytes), refusal_(std::move(refusal)) {}

  void take(std::uint64_t bytes) {
    for (std::uint64_t used = used_.load();;) {
      if (bytes > limit_ || used > limit_ - bytes) throw Error(ErrorKind::storage, refusal_());
      if (used_.compare_exchange_weak(used, used + bytes)) return;
    }
  }
  void give_back(std::uint64_t bytes) noexcept { used_ -= bytes; }

 private:
  const std::uint64_t limit_;
  const std::function<std::string()> refusal_;
  std::atomic<std::uint64_t> used_{0};
};

/// What one file has taken, until nobody has it open.
class Taken {
 public:
  explicit Taken(std::shared_ptr<Allowance> allowance) : allowance_(std::move(allowance)) {}
  ~Taken() { allowance_->give_back(bytes_); }
  Taken(const Taken&) = delete;
  Taken& operator=(const Taken&) = delete;
  void add(std::uint64_t bytes) {
    allowance_->take(bytes);
    bytes_ += bytes;
  }

 private:
  const std::shared_ptr<Allowance> allowance_;
  std::uint64_t bytes_ = 0;
};

class LimitedRead final : public ReadFile {
 public:
  LimitedRead(std::unique_ptr<ReadFile> file, std::shared_ptr<Taken> taken)
      : taken_(std::move(taken)), file_(std::move(file)) {}
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    file_->read(offset, out);
  }

 private:
  const std::shared_ptr<Taken> taken_;  // goes after the file
  const std::unique_ptr<ReadFile> file_;
};

class LimitedWrite final : public WriteFile {
 public:
  LimitedWrite(std::unique_ptr<WriteFile> file, std::shared_ptr<Taken> taken)
      : taken_(std::move(taken)), file_(std::move(file)) {}
  void append(std::span<const std::byte> bytes) override {
    taken_->add(bytes.size());
    file_->append(bytes);
  }
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void sync() override { file_->sync(); }
  std::unique_ptr<ReadFile> reader() const override {
    return std::make_unique<LimitedRead>(file_->reader(), taken_);
  }

 private:
  const std::shared_ptr<Taken> taken_;
  const std::unique_ptr<WriteFile> file_;
};

class LimitedFileSystem final : public FileSystem {
 public:
  LimitedFileSystem(FileSystem& files, std::shared_ptr<Allowance> allowance)
      : files_(files), allowance_(std::move(allowance)) {}

  std::unique_ptr<WriteFile> create_scratch(const std::string& folder) override {
    return std::make_unique<LimitedWrite>(files_.create_scratch(folder),
                                          std::make_shared<Taken>(allowance_));
  }

  std::unique_ptr<ReadFile> open(const std::string& path) override { return files_.open(path); }
  std::unique_ptr<WriteFile> create(const std::string& path) override {
    return files_.create(path);
  }
  bool exists(const std::string& path) override { return files_.exists(path); }
  void rename(const std::string& from, const std::string& to) override { files_.rename(from, to); }
  void remove(const std::string& path) override { files_.remove(path); }
  void make_folders(const std::string& path) override { files_.make_folders(path); }
  void sync_folder(const std::string& path) override { files_.sync_folder(path); }
  std::vector<std::string> list(const std::string& folder) override { return files_.list(folder); }
  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    return files_.try_lock(path);
  }
  std::unique_ptr<ReadFile> open_held(const std::string& path) override {
    return files_.open_held(path);
  }
  std::unique_ptr<WriteFile> create_held(const std::string& path) override {
    return files_.create_held(path);
  }
  std::unique_ptr<ReadFile> open_private(const std::string& path) override {
    return files_.open_private(path);
  }
  std::unique_ptr<WriteFile> create_private(const std::string& path) override {
    return files_.create_private(path);
  }
  bool remove_unheld(const std::string& path) override { return files_.remove_unheld(path); }
  bool rename_new(const std::string& from, const std::string& to) override {
    return files_.rename_new(from, to);
  }
  std::optional<FileStatus> status(const std::string& path) override { return files_.status(path); }
  void touch(const std::string& path) override { files_.touch(path); }
  void resize(const std::string& path, std::uint64_t size_bytes) override {
    files_.resize(path, size_bytes);
  }
  bool is_writable(const std::string& folder) override { return files_.is_writable(folder); }
  std::uint64_t disk_bytes(const std::string& folder) override { return files_.disk_bytes(folder); }
  std::uint64_t free_bytes(const std::string& folder) override { return files_.free_bytes(folder); }

 private:
  FileSystem& files_;
  const std::shared_ptr<Allowance> allowance_;
};

}  // namespace

std::uint64_t default_scratch_limit(FileSystem& files, const std::string& folder) {
  constexpr std::uint64_t kLeast = 1ULL << 30;
  const std::uint64_t free = files.free_bytes(folder);
  return free == std::numeric_limits<std::uint64_t>::max() ? 0 : std::max(free / 10, kLeast);
}

std::unique_ptr<FileSystem> limit_scratch(FileSystem& files, std::uint64_t limit_bytes,
                                          std::function<std::string()> refusal) {
  return std::make_unique<LimitedFileSystem>(
      files, std::make_shared<Allowance>(limit_bytes, std::move(refusal)));
}

}  // namespace pounce
