// SPDX-License-Identifier: Apache-2.0
//
// What a tile cache looks like on disk: names, what a look around finds, and the room it takes.
// docs/cache.md tells it to users.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/hash.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// Every kind that has a folder of its own. A new kind of pack is added here and in kind_name().
inline constexpr std::array kCachedKinds = {PackKind::geometry, PackKind::colour, PackKind::results,
                                            PackKind::splats, PackKind::hits};
/// "geometry", "colour", ...: also the folder's name.
const char* kind_name(PackKind kind);

/// Begins the name of a lock that is only tried.
inline constexpr const char* kProbe = "probe-";

/// Names below a cache's root.
class CacheLayout {
 public:
  /// `root` without the version.
  explicit CacheLayout(const std::string& root);
  const std::string& folder() const { return folder_; }  ///< with the version
  std::string kind_folder(PackKind kind) const;
  std::string pack(PackKind kind, const Hash128& key) const;
  std::string label(PackKind kind,
                    const Hash128& key) const;  ///< text: what the pack was made from
  std::string key_lock(PackKind kind, const Hash128& key) const;  ///< held while the pack is made
  std::string locks_folder() const { return folder_ + "/locks"; }
  std::string parts_folder() const { return folder_ + "/tmp"; }
  std::string space_lock() const { return folder_ + "/space.lock"; }
  std::string hash_memo() const;  ///< of this user

 private:
  std::string folder_;
};

/// One published pack.
struct CachedObject {
  PackKind kind = PackKind::geometry;
  Hash128 key;
  std::string path, label_path;   ///< label_path is empty if it has none
  std::uint64_t size_bytes = 0;   ///< of the pack file
  std::uint64_t taken_bytes = 0;  ///< room it takes, its label included
  std::int64_t last_used_ns = 0;  ///< since 1970
};

/// What lies in a cache at one moment. Files that come or go meanwhile are seen or not.
struct CacheScan {
  std::vector<CachedObject> objects;  ///< by last use, longest ago first; equal times by path
  std::vector<std::string> orphans;   ///< labels whose packs are gone
  std::uint64_t parts = 0;            ///< packs that are being written
  std::uint64_t part_bytes = 0;       ///< their room, at the length they reserved
  std::uint64_t total_bytes = 0;      ///< room that all files and folders below the root take
};
CacheScan scan_cache(FileSystem& files, const CacheLayout& layout);

/// Room on disk for a file of that size: whole pages. Independent of the file system, holes count.
constexpr std::uint64_t room_bytes(std::uint64_t size_bytes) {
  return (size_bytes + 4095) / 4096 * 4096;
}

/// The limit of a cache for which none was given: a tenth of the file system that holds it, or
/// will.
std::uint64_t default_limit_bytes(FileSystem& files, const std::string& root);

/// The key that 32 hexadecimal digits say.
std::optional<Hash128> key_from_hex(const std::string& text);

/// What evict() left and took.
struct Evicted {
  std::uint64_t objects = 0;
  std::uint64_t bytes = 0;
  std::uint64_t in_use = 0;        ///< objects that should have gone and are held by some process
  std::uint64_t in_use_bytes = 0;  ///< their room
};

/// Keeps a cache's room on disk below a limit. There are no counters that could drift: a look at
/// the files says what is taken, and a file that is being written has the length it reserved. A
/// look and what follows from it happen under one lock for all processes. What is added to what a
/// look has just found, while nobody else has had the lock, needs no other. Thread-safe.
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
  /// Against other threads, which need not try again and again, and against other processes.
  struct Held {
    std::unique_lock<std::mutex> threads;
    std::unique_ptr<FileLock> processes;
  };
  Held lock();
  std::uint64_t step_bytes() const;  ///< that a file reserves beyond what it needs
  std::uint64_t reserve_unseen(const FileLock& held, const std::string& part,
                               std::uint64_t reserved_bytes, std::uint64_t size_bytes);

  /// What the files take at most, if nobody else has grown one since a look.
  struct Known {
    std::uint64_t total_bytes = 0;
    std::uint64_t unwritten_bytes = 0;  ///< of these, what the disk may not have given yet
    std::uint64_t look = 0;             ///< which of this process's, whatever folder it was at
    std::chrono::steady_clock::time_point seen;
  };

  FileSystem& files_;
  const CacheLayout layout_;
  const std::uint64_t limit_bytes_;
  const std::function<void()> stopped_;
  std::mutex mutex_;  ///< guards known_
  std::optional<Known> known_;
};

/// Removes what dead processes left half-built. What a living one has open stays.
void remove_leftovers(FileSystem& files, const CacheLayout& layout);

}  // namespace pounce::store
