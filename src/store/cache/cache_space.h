// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/file.h"
#include "store/cache/cache_layout.h"

namespace pounce::store {

/// What evict() left and took.
struct Evicted {
  std::uint64_t objects = 0;
  std::uint64_t bytes = 0;
  std::uint64_t in_use = 0;        ///< objects that should have gone and are held by some process
  std::uint64_t in_use_bytes = 0;  ///< their room
};

/// Keeps a cache's room on disk below a limit. There are no counters that could drift: a look at
/// the files says what is taken, and a file that is being written has the length it reserved. A
/// look and what follows from it happen under one lock for all processes. Thread-safe.
class CacheSpace {
 public:
  /// `limit_bytes` 0: none. `stopped` is asked while waiting for the lock; may throw.
  CacheSpace(FileSystem& files, CacheLayout layout, std::uint64_t limit_bytes,
             std::function<void()> stopped);

  /// Makes sure that the file at `part`, `reserved_bytes` long, may grow to `size_bytes`, removing
  /// the objects used longest ago if the limit, or the disk, has no room; makes it as long as it
  /// may grow now and returns that length, its new reserved_bytes; 0 if it does not fit.
  std::uint64_t reserve(const std::string& part, std::uint64_t reserved_bytes,
                        std::uint64_t size_bytes);
  std::uint64_t limit_bytes() const { return limit_bytes_; }
  const CacheLayout& layout() const { return layout_; }

  /// Removes objects that `unwanted` names, longest unused first, until the cache takes no more
  /// than `most_bytes`. Objects in use stay.
  Evicted evict(std::uint64_t most_bytes, const std::function<bool(const CachedObject&)>& unwanted);

 private:
  /// What was tried is no longer in `scan`, whether it went or not.
  Evicted evict_locked(CacheScan& scan, std::uint64_t most_bytes,
                       const std::function<bool(const CachedObject&)>& unwanted);
  std::unique_ptr<FileLock> lock();

  FileSystem& files_;
  const CacheLayout layout_;
  const std::uint64_t limit_bytes_;
  const std::function<void()> stopped_;
};

/// Removes what dead processes left half-built. What a living one has open stays.
void remove_leftovers(FileSystem& files, const CacheLayout& layout);

}  // namespace pounce::store
