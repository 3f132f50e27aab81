// SPDX-License-Identifier: Apache-2.0
//
// Scratch packs by the thousand, as of the images of a thousand materials: each in a file of its
// own would cost more to make than to fill.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "core/file.h"

namespace pounce::store {

/// One nameless file in which small ones lie behind each other, for as long as it lives.
/// Thread-safe.
class SharedScratch {
 public:
  SharedScratch(FileSystem& files, std::string folder)
      : files_(files), folder_(std::move(folder)) {}

  /// A file that is appended to until its reader is asked for. What has grown to more than a few
  /// pages by then gets a file of its own. `this` must outlive it, but not its readers.
  std::unique_ptr<WriteFile> create();

 private:
  class Small;
  class Part;
  std::uint64_t add(std::span<const std::byte> bytes);  ///< returns where they lie

  FileSystem& files_;
  const std::string folder_;
  std::mutex mutex_;                        ///< guards the appending
  std::unique_ptr<WriteFile> file_;         ///< null until something is added
  std::shared_ptr<const ReadFile> reader_;  ///< of all of it
};

}  // namespace pounce::store
