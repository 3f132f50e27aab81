// SPDX-License-Identifier: Apache-2.0
#include "core/scratch_limit.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "pounce/error.h"

namespace pounce {
namespace {

/// What one file has taken, until nobody has it open.
class Taken {
 public:
  explicit Taken(std::shared_ptr<ScratchAccount> account) : account_(std::move(account)) {}
  ~Taken() { account_->give_back(bytes_); }
  Taken(const Taken&) = delete;
  Taken& operator=(const Taken&) = delete;
  void add(std::uint64_t bytes) {
    account_->take(bytes);
    bytes_ += bytes;
  }

 private:
  const std::shared_ptr<ScratchAccount> account_;
  std::uint64_t bytes_ = 0;
};

class CountedRead final : public ReadFile {
 public:
  CountedRead(std::unique_ptr<ReadFile> file, std::shared_ptr<Taken> taken)
      : taken_(std::move(taken)), file_(std::move(file)) {}
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    file_->read(offset, out);
  }

 private:
  const std::shared_ptr<Taken> taken_;  // goes after the file
  const std::unique_ptr<ReadFile> file_;
};

class CountedWrite final : public WriteFile {
 public:
  CountedWrite(std::unique_ptr<WriteFile> file, std::shared_ptr<Taken> taken)
      : taken_(std::move(taken)), file_(std::move(file)) {}
  void append(std::span<const std::byte> bytes) override {
    taken_->add(bytes.size());
    file_->append(bytes);
  }
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void sync() override { file_->sync(); }
  std::unique_ptr<ReadFile> reader() const override {
    return std::make_unique<CountedRead>(file_->reader(), taken_);
  }

 private:
  const std::shared_ptr<Taken> taken_;
  const std::unique_ptr<WriteFile> file_;
};

class CountingFileSystem final : public FileSystem {
 public:
  CountingFileSystem(FileSystem& files, std::shared_ptr<ScratchAccount> account)
      : files_(files), account_(std::move(account)) {}

  std::unique_ptr<WriteFile> create_scratch(const std::string& folder) override {
    return std::make_unique<CountedWrite>(files_.create_scratch(folder),
                                          std::make_shared<Taken>(account_));
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
  const std::shared_ptr<ScratchAccount> account_;
};

}  // namespace

void ScratchAccount::take(std::uint64_t bytes) {
  std::uint64_t used = used_.load();
  do {
    if (limit_ != 0 && (bytes > limit_ || used > limit_ - bytes))
      throw Error(ErrorKind::storage, refusal_());
  } while (!used_.compare_exchange_weak(used, used + bytes));
  for (std::uint64_t peak = peak_.load();
       peak < used + bytes && !peak_.compare_exchange_weak(peak, used + bytes);) {
  }
}

std::uint64_t default_scratch_limit(FileSystem& files, const std::string& folder) {
  constexpr std::uint64_t kLeast = 1ULL << 30;
  const std::uint64_t free = files.free_bytes(folder);
  return free == std::numeric_limits<std::uint64_t>::max() ? 0 : std::max(free / 10, kLeast);
}

std::unique_ptr<FileSystem> count_scratch(FileSystem& files,
                                          std::shared_ptr<ScratchAccount> account) {
  return std::make_unique<CountingFileSystem>(files, std::move(account));
}

}  // namespace pounce
