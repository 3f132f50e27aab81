// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pounce/error.h"
#include "pounce/export.h"

namespace pounce {

// The tile cache, looked at and tidied. Every function takes the cache's folder (empty = the
// default one), may run beside jobs that use it, and throws Error(storage) if the folder cannot be
// read, or changed where that is its purpose. A folder that does not exist is an empty cache.

/// $XDG_CACHE_HOME/pounce, else ~/.cache/pounce; empty if neither variable is set.
POUNCE_API std::string default_cache_folder();

/// One finished pack: a mesh or an image, prepared.
struct CacheObject {
  std::string kind;  ///< "geometry", "colour", ...
  std::string key;   ///< 32 hexadecimal digits: the hash of what it was made from
  std::string path;
  std::string label;             ///< what it was made from, for people; may be empty
  std::uint64_t size_bytes = 0;  ///< of the pack file
  double last_used_s = 0;        ///< seconds since 1970
};
/// What is in the cache, longest unused first.
POUNCE_API std::vector<CacheObject> cache_list(const std::string& folder = {});

/// Objects of one kind.
struct CacheShare {
  std::uint64_t objects = 0;
  std::uint64_t bytes = 0;  ///< of their pack files
};
struct CacheInfo {
  std::string folder;
  std::uint64_t taken_bytes = 0;          ///< room of all its files and folders, in whole pages
  std::uint64_t default_limit_bytes = 0;  ///< what a job without --cache-limit keeps to; 0 = none
  std::map<std::string, CacheShare> kinds;
  CacheShare unfinished;  ///< packs that are being written, or were when their process died
};
POUNCE_API CacheInfo cache_info(const std::string& folder = {});

/// One pack that does not hold what was written into it.
struct CacheDamage {
  CacheObject object;
  std::string what;      ///< where, and what does not match
  bool removed = false;  ///< it is no longer in the cache
};
struct CacheVerdict {
  std::uint64_t objects = 0;  ///< that were read
  std::uint64_t bytes = 0;
  std::vector<CacheDamage> damaged;
};
/// Reads every byte of every pack and checks it. `remove`: removes the damaged ones, also while
/// they are in use (their readers go on).
POUNCE_API CacheVerdict cache_verify(const std::string& folder = {}, bool remove = false);

/// What was removed, and what could not be.
struct CachePruned {
  std::uint64_t objects = 0;
  std::uint64_t bytes = 0;        ///< room that is free again
  std::uint64_t in_use = 0;       ///< objects that some process uses: they stay
  std::uint64_t taken_bytes = 0;  ///< room that the cache still takes
  /// Images that killed jobs, which used this cache, left half done beside their outputs: files,
  /// and their bytes.
  std::uint64_t half_done = 0, half_done_bytes = 0;
};
/// Removes objects, longest unused first: those not used for `older_than_s` seconds (if given), and
/// as many more as it takes to bring the cache to `most_bytes` (if given). With neither, nothing
/// but what dead processes left.
POUNCE_API CachePruned cache_prune(const std::string& folder,
                                   std::optional<std::uint64_t> most_bytes,
                                   std::optional<double> older_than_s);
/// Removes everything that no process uses.
POUNCE_API CachePruned cache_clear(const std::string& folder = {});

}  // namespace pounce
