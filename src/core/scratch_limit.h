// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "core/file.h"

namespace pounce {

/// What scratch files may take together when nobody says: a tenth of the room that is free in
/// `folder`, but 1 GiB at least; 0 = no limit, where nobody knows the room.
std::uint64_t default_scratch_limit(FileSystem& files, const std::string& folder);

/// `files`, whose scratch files take no more than `limit_bytes` together: what would make them take
/// more throws Error(storage) with what `refusal` says. A file counts until its writer and its
/// readers are gone. Thread-safe, if `refusal` is. `files` must outlive it and every file.
std::unique_ptr<FileSystem> limit_scratch(FileSystem& files, std::uint64_t limit_bytes,
                                          std::function<std::string()> refusal);

/// Where scratch files are made.
struct ScratchFolder {
  FileSystem* files = nullptr;
  std::string path;
  std::unique_ptr<WriteFile> create() const { return files->create_scratch(path); }
};

}  // namespace pounce
