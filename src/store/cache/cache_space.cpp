// SPDX-License-Identifier: Apache-2.0
#include "store/cache/cache_space.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "pounce/error.h"

namespace pounce::store {
namespace {

/// Room for what comes with a pack: its label, its key's lock, a longer folder.
constexpr std::uint64_t kBesideBytes = 24 << 10;
/// The most that a file was given and keeps in memory.
constexpr std::uint64_t kUnwrittenBytes = 1 << 20;
/// A file reserves this share of the limit at a time: fewer looks at the folder, little in vain.
constexpr std::uint64_t kStepsPerLimit = 64;
constexpr std::uint64_t kSmallestStep = 64 << 10, kLargestStep = 16 << 20;

/// Removes an object unless some process holds it; one that may not be removed counts as held.
bool remove_object(FileSystem& files, const CachedObject& object) {
  try {
    if (!files.remove_unheld(object.path)) return false;
  } catch (const Error&) {
    return false;
  }
  try {
    if (!object.label_path.empty()) files.remove(object.label_path);
  } catch (const Error&) {
    // It hurts nobody.
  }
  return true;
}

}  // namespace

CacheSpace::CacheSpace(FileSystem& files, CacheLayout layout, std::uint64_t limit_bytes,
                       std::function<void()> stopped)
    : files_(files),
      layout_(std::move(layout)),
      limit_bytes_(limit_bytes),
      stopped_(std::move(stopped)) {}

std::unique_ptr<FileLock> CacheSpace::lock() {
  for (;;) {
    if (auto lock = files_.try_lock(layout_.space_lock())) return lock;
    if (stopped_) stopped_();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));  // it is held for a look around
  }
}

std::uint64_t CacheSpace::reserve(const std::string& part, std::uint64_t reserved_bytes,
                                  std::uint64_t size_bytes) {
  if (limit_bytes_ == 0) return UINT64_MAX;
  const auto held = lock();
  CacheScan scan = scan_cache(files_, layout_);
  const std::uint64_t own = room_bytes(reserved_bytes);
  const std::uint64_t beside = std::max<std::uint64_t>(scan.parts, 1) * kBesideBytes;
  const std::uint64_t step = std::clamp(limit_bytes_ / kStepsPerLimit, kSmallestStep, kLargestStep);
  // A disk that fills up is a lower limit. What parts reserved and did not write yet is still free.
  const std::uint64_t free = files_.free_bytes(layout_.folder());
  const std::uint64_t unwritten = std::max<std::uint64_t>(scan.parts, 1) * (step + kUnwrittenBytes);
  const std::uint64_t spare = free - std::min(free, unwritten);
  const std::uint64_t limit =
      spare < limit_bytes_ ? std::min(limit_bytes_, scan.total_bytes + spare) : limit_bytes_;
  for (const std::uint64_t size : {size_bytes + step, size_bytes}) {
    // What the cache may take before this file grows.
    const std::uint64_t growth = room_bytes(size) - own + beside;
    if (growth > limit) continue;
    const std::uint64_t most = limit - growth;
    // Before anything goes: would it be enough? An object that cannot fit must not empty the cache.
    std::uint64_t evictable = 0;
    for (const CachedObject& object : scan.objects) evictable += object.taken_bytes;
    if (scan.total_bytes > most + evictable) continue;
    evict_locked(scan, most, nullptr);
    if (scan.total_bytes > most) continue;  // the rest is in use: without the step it may do
    try {
      files_.resize(part, size);
      return size;
    } catch (const Error&) {
      // Files may be limited (ulimit -f) to less than what is reserved beyond what is needed.
      if (size == size_bytes) throw;
    }
  }
  return 0;
}

Evicted CacheSpace::evict(std::uint64_t most_bytes,
                          const std::function<bool(const CachedObject&)>& unwanted) {
  const auto held = lock();
  CacheScan scan = scan_cache(files_, layout_);
  return evict_locked(scan, most_bytes, unwanted);
}

Evicted CacheSpace::evict_locked(CacheScan& scan, std::uint64_t most_bytes,
                                 const std::function<bool(const CachedObject&)>& unwanted) {
  Evicted evicted;
  for (const std::string& orphan : scan.orphans) {
    try {
      files_.remove(orphan);
    } catch (const Error&) {
      // Another user's, in a folder where each removes their own.
    }
  }
  auto next = scan.objects.begin();
  for (; next != scan.objects.end() && scan.total_bytes > most_bytes; ++next) {
    const CachedObject& object = *next;
    if (unwanted && !unwanted(object)) continue;
    if (!remove_object(files_, object)) {
      ++evicted.in_use;
      evicted.in_use_bytes += object.taken_bytes;
      continue;
    }
    ++evicted.objects;
    evicted.bytes += object.taken_bytes;
    scan.total_bytes -= std::min(scan.total_bytes, object.taken_bytes);
  }
  scan.objects.erase(scan.objects.begin(), next);
  return evicted;
}

namespace {

/// Only what jobs leave is removed, wherever the folder may lead.
bool is_leftover(const std::string& name) {
  if (name.ends_with(".part") || name.ends_with(".hashes")) return true;
  const std::size_t key = name.find('-') + 1;
  return key != 0 && key_from_hex(name.substr(key)).has_value();
}

}  // namespace

void remove_leftovers(FileSystem& files, const CacheLayout& layout) {
  for (const std::string& folder : {layout.parts_folder(), layout.locks_folder()}) {
    for (const std::string& name : files.list(folder)) {
      if (!is_leftover(name)) continue;
      try {
        files.remove_unheld(folder + "/" + name);
      } catch (const Error&) {
        // Another user's, in a folder that is shared: it is theirs to remove.
      }
    }
  }
}

}  // namespace pounce::store
