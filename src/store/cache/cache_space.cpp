// SPDX-License-Identifier: Apache-2.0
//
// How several processes keep one folder below one limit without a server and without a counter that
// a killed process would leave wrong: what is taken is looked up, each time, from the files that
// are there. So that looks stay few, a pack that is being written reserves room in steps: its file
// is made longer than what is in it, and its length is what everybody counts. A look and what
// follows from it (removing packs, growing a file) happen under one lock, space.lock.
//
// A look costs a call for each file, and a job may add thousands. So a process that had the lock
// last adds to what its last look has found: others that grow a file must have had the lock in
// between, and have written that into its file. Those that remove one leave more room than is
// known. It looks again a second later, and near the limit each time: other programs need no lock,
// nor do small files of other processes. Where somebody might lock the file who cannot write to it,
// as in folders that users share, it looks each time.
//
// What goes first is what was used longest ago, by the time that find() sets on a pack. A pack that
// some process has open stays whatever the limit says: removing it would free nothing.
//
// The lock is held for a scan of the folder, so scans must stay short (docs/decisions/009). Files
// of other programs in the folder count as taken space, and are never removed.
#include "store/cache/cache_space.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <thread>
#include <tuple>
#include <utility>

#include "pounce/error.h"

namespace pounce::store {
namespace {

constexpr std::string_view kPackEnding = ".pack";
constexpr std::string_view kLabelEnding = ".label";

/// The key that a file name stands for, if it has this ending and is one of ours.
std::optional<Hash128> key_of(const std::string& name, std::string_view ending) {
  if (!name.ends_with(ending)) return std::nullopt;
  return key_from_hex(name.substr(0, name.size() - ending.size()));
}

/// Adds one folder's own room and that of its files; packs and labels become objects.
class Scanner {
 public:
  Scanner(FileSystem& files, const CacheLayout& layout) : files_(files), layout_(layout) {}

  CacheScan scan() {
    // Whatever lies there takes room, ours or not.
    for (const std::string& name : list(layout_.folder())) add(layout_.folder() + "/" + name);
    for (const PackKind kind : kCachedKinds) add_packs(kind);
    for (const std::string& name : list(layout_.locks_folder())) {
      add(layout_.locks_folder() + "/" + name);
    }
    for (const std::string& name : list(layout_.parts_folder())) {
      scan_.part_bytes += add(layout_.parts_folder() + "/" + name);
      ++scan_.parts;
    }
    std::sort(scan_.objects.begin(), scan_.objects.end(),
              [](const CachedObject& a, const CachedObject& b) {
                return std::tie(a.last_used_ns, a.path) < std::tie(b.last_used_ns, b.path);
              });
    return std::move(scan_);
  }

 private:
  std::vector<std::string> list(const std::string& folder) {
    return files_.exists(folder) ? files_.list(folder) : std::vector<std::string>();
  }

  std::uint64_t add(const std::string& path) {
    const auto status = files_.status(path);
    // The length of a folder means something else on every file system.
    const std::uint64_t size = status && status->is_folder ? 1 : status ? status->size_bytes : 0;
    const std::uint64_t room = room_bytes(size);
    scan_.total_bytes += room;
    return room;
  }

  // Names are sorted, so a label finds its pack, and a pack its label, without another call.
  void add_packs(PackKind kind) {
    const std::string folder = layout_.kind_folder(kind);
    const std::vector<std::string> names = list(folder);
    for (const std::string& name : names) {
      const std::string path = folder + "/" + name;
      if (const auto key = key_of(name, kPackEnding)) {
        if (const auto status = files_.status(path)) add_object(kind, *key, path, *status, names);
      } else if (const auto labelled = key_of(name, kLabelEnding)) {
        add(path);
        const std::string pack = to_hex(*labelled) + std::string(kPackEnding);
        if (!std::binary_search(names.begin(), names.end(), pack)) scan_.orphans.push_back(path);
      } else {
        add(path);
      }
    }
  }

  void add_object(PackKind kind, const Hash128& key, const std::string& path,
                  const FileStatus& status, const std::vector<std::string>& names) {
    CachedObject object{kind, key, path, "", status.size_bytes, 0, status.modified_ns};
    // Its label is counted once, where the loop above comes to it; here it only goes along.
    object.taken_bytes = room_bytes(status.size_bytes);
    scan_.total_bytes += object.taken_bytes;
    const std::string label = to_hex(key) + std::string(kLabelEnding);
    if (std::binary_search(names.begin(), names.end(), label)) {
      object.label_path = layout_.label(kind, key);
      object.taken_bytes += room_bytes(1);
    }
    scan_.objects.push_back(std::move(object));
  }

  FileSystem& files_;
  const CacheLayout& layout_;
  CacheScan scan_;
};

/// Room for what comes with a pack: its label, its key's lock, a longer folder.
constexpr std::uint64_t kBesideBytes = 24 << 10;
/// The most that a file was given and keeps in memory.
constexpr std::uint64_t kUnwrittenBytes = 1 << 20;
/// A file reserves this share of the limit at a time: fewer looks at the folder, little in vain.
constexpr std::uint64_t kStepsPerLimit = 64;
constexpr std::uint64_t kSmallestStep = 64 << 10, kLargestStep = 16 << 20;
constexpr auto kLookAgain = std::chrono::seconds(1);
/// The least room left for what others add meanwhile without the lock: labels, locks of keys.
constexpr std::uint64_t kUnseenBytes = 2 << 20;

/// Counts whatever this process does under a lock: its caches share its number.
std::atomic<std::uint64_t> looks{0};

/// Removes an object unless some process holds it; one that may not be removed counts as held.
bool remove_object(FileSystem& files, const CachedObject& object) {
  // The pack first: without it the label is an orphan, which goes next time.
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

const char* kind_name(PackKind kind) {
  switch (kind) {
    case PackKind::geometry:
      return "geometry";
    case PackKind::colour:
      return "colour";
    case PackKind::results:
      return "results";
    case PackKind::splats:
      return "splats";
    case PackKind::hits:
      return "hits";
  }
  throw Error(ErrorKind::internal, "a pack of an unknown kind (please report)");
}

CacheLayout::CacheLayout(const std::string& root)
    : folder_(fmt::format("{}/v{}", root, kFormatVersion)) {}

std::string CacheLayout::kind_folder(PackKind kind) const {
  return fmt::format("{}/{}", folder_, kind_name(kind));
}
std::string CacheLayout::pack(PackKind kind, const Hash128& key) const {
  return fmt::format("{}/{}{}", kind_folder(kind), to_hex(key), kPackEnding);
}
std::string CacheLayout::label(PackKind kind, const Hash128& key) const {
  return fmt::format("{}/{}{}", kind_folder(kind), to_hex(key), kLabelEnding);
}
std::string CacheLayout::hash_memo() const {
  return fmt::format("{}/hashes-{}", folder_, ::geteuid());
}
std::string CacheLayout::key_lock(PackKind kind, const Hash128& key) const {
  return fmt::format("{}/{}-{}", locks_folder(), kind_name(kind), to_hex(key));
}

CacheScan scan_cache(FileSystem& files, const CacheLayout& layout) {
  return Scanner(files, layout).scan();
}

std::uint64_t default_limit_bytes(FileSystem& files, const std::string& root) {
  // The cache may not be there yet: the nearest folder that is tells its file system.
  std::filesystem::path folder = root;
  while (!folder.empty() && !files.exists(folder.string())) {
    if (folder == folder.parent_path()) break;
    folder = folder.parent_path();
  }
  return files.disk_bytes(folder.empty() ? "." : folder.string()) / 10;
}

std::optional<Hash128> key_from_hex(const std::string& text) {
  if (text.size() != 32) return std::nullopt;
  Hash128 key;
  const char* const middle = text.data() + 16;
  const auto [end_hi, bad_hi] = std::from_chars(text.data(), middle, key.hi, 16);
  const auto [end_lo, bad_lo] = std::from_chars(middle, middle + 16, key.lo, 16);
  if (bad_hi != std::errc() || bad_lo != std::errc() || end_hi != middle || end_lo != middle + 16) {
    return std::nullopt;
  }
  // Upper-case digits are a number as well, but no name of ours.
  return to_hex(key) == text ? std::optional(key) : std::nullopt;
}

CacheSpace::CacheSpace(FileSystem& files, CacheLayout layout, std::uint64_t limit_bytes,
                       std::function<void()> stopped)
    : files_(files),
      layout_(std::move(layout)),
      limit_bytes_(limit_bytes),
      stopped_(std::move(stopped)) {}

CacheSpace::Held CacheSpace::lock() {
  std::unique_lock threads(mutex_);
  for (;;) {
    if (auto processes = files_.try_lock(layout_.space_lock()))
      return {std::move(threads), std::move(processes)};
    if (stopped_) stopped_();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));  // it is held for a look around
  }
}

std::uint64_t CacheSpace::reserve(const std::string& part, std::uint64_t reserved_bytes,
                                  std::uint64_t size_bytes) {
  if (limit_bytes_ == 0) return UINT64_MAX;
  const auto held = lock();
  // From here to the end nobody else looks or grows.
  if (const std::uint64_t size = reserve_unseen(*held.processes, part, reserved_bytes, size_bytes);
      size > 0)
    return size;
  known_.reset();
  const std::uint64_t look = ++looks;
  const auto now = std::chrono::steady_clock::now();
  CacheScan scan = scan_cache(files_, layout_);
  const std::uint64_t own = room_bytes(reserved_bytes);
  const std::uint64_t beside = std::max<std::uint64_t>(scan.parts, 1) * kBesideBytes;
  const std::uint64_t step = step_bytes();
  // A disk that fills up is a lower limit. What parts reserved and did not write yet is still free.
  const std::uint64_t free = files_.free_bytes(layout_.folder());
  const std::uint64_t unwritten = std::max<std::uint64_t>(scan.parts, 1) * (step + kUnwrittenBytes);
  const std::uint64_t spare = free - std::min(free, unwritten);
  const std::uint64_t limit =
      spare < limit_bytes_ ? std::min(limit_bytes_, scan.total_bytes + spare) : limit_bytes_;
  // With a step to spare if there is room for it, else just what is asked for.
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
      known_ = {scan.total_bytes + growth, unwritten, look, now};
      return size;
    } catch (const Error&) {
      // Files may be limited (ulimit -f) to less than what is reserved beyond what is needed.
      if (size == size_bytes) throw;
    }
  }
  return 0;
}

/// The same where what is known suffices; 0: it does not.
std::uint64_t CacheSpace::reserve_unseen(const FileLock& held, const std::string& part,
                                         std::uint64_t reserved_bytes, std::uint64_t size_bytes) {
  const auto now = std::chrono::steady_clock::now();
  if (!known_ || known_->look != looks || !held.was_ours() || now - known_->seen > kLookAgain ||
      !files_.lets_all_write(layout_.space_lock(), layout_.parts_folder()))
    return 0;
  // Of a pack that grows large in few steps.
  const std::uint64_t size = size_bytes + std::min(size_bytes / 2, step_bytes());
  // The room beside counts for each file that is begun.
  const std::uint64_t growth =
      room_bytes(size) - room_bytes(reserved_bytes) + (reserved_bytes == 0 ? kBesideBytes : 0);
  known_->total_bytes += growth;
  known_->unwritten_bytes += growth + kUnwrittenBytes;
  if (known_->total_bytes + std::max(kUnseenBytes, step_bytes()) > limit_bytes_ ||
      known_->unwritten_bytes > files_.free_bytes(layout_.folder()))
    return 0;
  try {
    files_.resize(part, size);
  } catch (const Error&) {
    return 0;  // as where files may not be that long: a look asks for less
  }
  return size;
}

std::uint64_t CacheSpace::step_bytes() const {
  return std::clamp(limit_bytes_ / kStepsPerLimit, kSmallestStep, kLargestStep);
}

Evicted CacheSpace::evict(std::uint64_t most_bytes,
                          const std::function<bool(const CachedObject&)>& unwanted) {
  const auto held = lock();
  ++looks;
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
  // From the one used longest ago. What is in use is passed over: its room is not to be had.
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
  if (name.ends_with(".part") || name.ends_with(".hashes") || name.starts_with(kProbe)) return true;
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
