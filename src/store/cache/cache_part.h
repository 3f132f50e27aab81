// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "core/file.h"
#include "store/cache/cache_space.h"

namespace pounce::store {

/// A pack of the cache while it is being written: a file under a temporary name that grows as far
/// as the cache's limit lets it. Where it does not, its content moves to a nameless scratch file,
/// the name goes, and writing continues there. Removed with this object unless it was published.
/// Not thread-safe.
class CachePart final : public WriteFile {
 public:
  /// `file` is the one at `path`, held. `claim` is the lock on the pack's key, may be null.
  CachePart(FileSystem& files, CacheSpace& space, std::string path, std::unique_ptr<WriteFile> file,
            std::string scratch_folder, std::unique_ptr<FileLock> claim);
  ~CachePart() override;

  void append(std::span<const std::byte> bytes) override;
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void sync() override { file_->sync(); }
  std::unique_ptr<ReadFile> reader() const override { return file_->reader(); }

  bool in_scratch() const { return in_scratch_; }
  /// Brings the content to the disk and gives the file its real name; if that exists already, this
  /// one's name goes.
  void publish(const std::string& to);
  /// Lets others have the key.
  void release_claim() { claim_.reset(); }

 private:
  void move_to_scratch();

  FileSystem& files_;
  CacheSpace& space_;
  const std::string path_;
  const std::string scratch_folder_;
  std::unique_ptr<FileLock> claim_;
  std::unique_ptr<WriteFile> file_;
  std::uint64_t reserved_bytes_ = 0;
  bool in_scratch_ = false, named_ = true;
};

}  // namespace pounce::store
