// SPDX-License-Identifier: Apache-2.0
#include "store/cache/cache_part.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "pounce/error.h"

namespace pounce::store {
namespace {
constexpr std::uint64_t kCopyBytes = 1 << 20;
}

CachePart::CachePart(FileSystem& files, CacheSpace& space, std::string path,
                     std::unique_ptr<WriteFile> file, std::string scratch_folder,
                     std::unique_ptr<FileLock> claim)
    : files_(files),
      space_(space),
      path_(std::move(path)),
      scratch_folder_(std::move(scratch_folder)),
      claim_(std::move(claim)),
      file_(std::move(file)) {}

CachePart::~CachePart() {
  if (!named_) return;
  try {
    files_.remove(path_);
  } catch (const Error&) {
    // It stays as a leftover, which the next run removes.
  }
}

void CachePart::append(std::span<const std::byte> bytes) {
  const std::uint64_t size = file_->size_bytes() + bytes.size();
  if (!in_scratch_ && size > reserved_bytes_) {
    reserved_bytes_ = space_.reserve(path_, reserved_bytes_, size);
    if (reserved_bytes_ == 0) move_to_scratch();
  }
  file_->append(bytes);
}

void CachePart::move_to_scratch() {
  auto scratch = files_.create_scratch(scratch_folder_);
  if (const std::uint64_t size = file_->size_bytes(); size > 0) {
    const auto written = file_->reader();
    std::vector<std::byte> piece;
    for (std::uint64_t at = 0; at < size; at += piece.size()) {
      piece.resize(static_cast<std::size_t>(std::min(kCopyBytes, size - at)));
      written->read(at, piece);
      scratch->append(piece);
    }
  }
  file_ = std::move(scratch);
  in_scratch_ = true;
  files_.remove(path_);
  named_ = false;
}

void CachePart::publish(const std::string& to) {
  const std::uint64_t size = file_->size_bytes();
  file_->sync();
  if (reserved_bytes_ != UINT64_MAX) {
    files_.resize(path_, size);  // what was reserved and not needed
    file_->sync();
  }
  if (files_.rename_new(path_, to)) {
    named_ = false;
    return;
  }
  files_.remove(path_);
  named_ = false;
}

}  // namespace pounce::store
