// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "core/file.h"

namespace pounce {

/// What scratch files may take together when nobody says: a tenth of the room that is free in
/// `folder`, but 1 GiB at least; 0 = no limit, where nobody knows the room.
std::uint64_t default_scratch_limit(FileSystem& files, const std::string& folder);

/// What the scratch files of a job take together, to the byte. Thread-safe, if `refusal` is.
class ScratchAccount {
 public:
  /// What would take more than `limit_bytes` (0 = any) throws Error(storage) with what `refusal`
  /// says.
  ScratchAccount(std::uint64_t limit_bytes, std::function<std::string()> refusal)
      : limit_(limit_bytes), refusal_(std::move(refusal)) {}

  void take(std::uint64_t bytes);
  void give_back(std::uint64_t bytes) noexcept { used_ -= bytes; }
  /// The most at one moment.
  std::uint64_t peak_bytes() const { return peak_; }

 private:
  const std::uint64_t limit_;
  const std::function<std::string()> refusal_;
  std::atomic<std::uint64_t> used_{0}, peak_{0};
};

/// `files`, whose scratch files are counted in `account`: each until its writer and its readers are
/// gone. `files` must outlive it and every file.
std::unique_ptr<FileSystem> count_scratch(FileSystem& files,
                                          std::shared_ptr<ScratchAccount> account);

/// Where scratch files are made.
struct ScratchFolder {
  FileSystem* files = nullptr;
  std::string path;
  std::unique_ptr<WriteFile> create() const { return files->create_scratch(path); }
};

}  // namespace pounce
