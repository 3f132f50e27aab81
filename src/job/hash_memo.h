// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/hash.h"

namespace pounce::job {

/// Content hashes of large input files, remembered from run to run, so that a scene of many GB is
/// not read from end to end only to find that its store is there. A file is known by device, inode,
/// size and both times; the time of its last change cannot be set by any program. What was changed
/// so shortly before it was hashed that a later change could carry the same time is not remembered
/// (git calls such files racily clean).
///
/// One small file per user in the cache (whoever could write it could have any scene taken for any
/// other, so nobody's is believed but one's own), replaced as a whole and checked by a checksum:
/// several processes may write it, the last one wins, and what is damaged or lost is hashed again.
/// Thread-safe.
class HashMemo {
 public:
  /// Files (or parts of files) below this are hashed each time: 5 ms at 3 GB/s.
  static constexpr std::uint64_t kLeastBytes = 16 << 20;

  /// `path` is where it lives, `parts_folder` where it is written.
  HashMemo(FileSystem& files, std::string path, std::string parts_folder);

  /// The hash of `size_bytes` (0 = all) of the file at `path` from `offset` on: remembered, or
  /// computed now.
  Hash128 get(const std::string& path, std::uint64_t offset, std::uint64_t size_bytes,
              const std::function<Hash128()>& compute);

 private:
  /// Device, inode, size and times of a file, then offset and size of the part.
  using Identity = std::array<std::uint64_t, 7>;
  struct Entry {
    Identity identity;
    Hash128 hash;
  };

  std::vector<Entry> load() const;
  void save(std::vector<Entry> entries);

  FileSystem& files_;
  const std::string path_, parts_folder_;
  std::mutex mutex_;  // one change at a time
};

}  // namespace pounce::job
