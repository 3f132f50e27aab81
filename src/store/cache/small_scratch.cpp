// SPDX-License-Identifier: Apache-2.0
//
// What such a file holds stays in memory until it is complete, so that it lies in one piece.
#include "store/cache/small_scratch.h"

#include <optional>
#include <utility>
#include <vector>

#include "pounce/error.h"

namespace pounce::store {
namespace {

constexpr std::size_t kSmallBytes = 64 << 10;

}  // namespace

/// A piece of the shared file.
class SharedScratch::Part final : public ReadFile {
 public:
  Part(std::shared_ptr<const ReadFile> file, std::uint64_t begin, std::uint64_t size)
      : file_(std::move(file)), begin_(begin), size_(size) {}
  std::uint64_t size_bytes() const override { return size_; }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    // Behind it lies another's.
    if (offset > size_ || out.size() > size_ - offset)
      throw Error(ErrorKind::storage, "a scratch file was read beyond its end (please report)");
    file_->read(begin_ + offset, out);
  }

 private:
  const std::shared_ptr<const ReadFile> file_;
  const std::uint64_t begin_, size_;
};

class SharedScratch::Small final : public WriteFile {
 public:
  explicit Small(SharedScratch& shared) : shared_(shared) {}

  void append(std::span<const std::byte> bytes) override {
    if (place_) throw Error(ErrorKind::internal, "a complete file was appended to (please report)");
    if (own_ == nullptr && held_.size() + bytes.size() > kSmallBytes) {
      own_ = shared_.files_.create_scratch(shared_.folder_);
      own_->append(held_);
      held_ = {};
    }
    if (own_ != nullptr) return own_->append(bytes);
    held_.insert(held_.end(), bytes.begin(), bytes.end());
    size_ = held_.size();
  }
  std::uint64_t size_bytes() const override { return own_ != nullptr ? own_->size_bytes() : size_; }
  void sync() override {
    if (own_ != nullptr) own_->sync();
  }
  std::unique_ptr<ReadFile> reader() const override {
    if (own_ != nullptr) return own_->reader();
    if (!place_) {
      place_ = shared_.add(held_);
      held_ = {};
    }
    return std::make_unique<Part>(shared_.reader_, *place_, size_);
  }

 private:
  SharedScratch& shared_;
  mutable std::vector<std::byte> held_;         ///< until it has a place
  mutable std::optional<std::uint64_t> place_;  ///< in the shared file
  std::uint64_t size_ = 0;
  std::unique_ptr<WriteFile> own_;
};

std::unique_ptr<WriteFile> SharedScratch::create() { return std::make_unique<Small>(*this); }

std::uint64_t SharedScratch::add(std::span<const std::byte> bytes) {
  const std::lock_guard lock(mutex_);
  if (file_ == nullptr) {
    file_ = files_.create_scratch(folder_);
    reader_ = file_->reader();
  }
  const std::uint64_t begin = file_->size_bytes();
  file_->append(bytes);
  return begin;
}

}  // namespace pounce::store
