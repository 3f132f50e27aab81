// SPDX-License-Identifier: Apache-2.0
//
// Looking at a cache and tidying it, beside whatever jobs use it.
//
// Nothing here locks the cache as a whole. A file that a job holds open cannot be evicted (it
// counts as in use), and one that goes between listing and opening was evicted by somebody else: it
// is passed over. A missing folder is an empty cache, and is not made.
//
// So every number is of one moment. Between a listing and an eviction packs may come, go or be
// used, and nothing here relies on their staying. Removing is safe at any time: a job that misses a
// pack builds it again (docs/cache.md).
#include "pounce/cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <span>

#include "core/own_errors.h"
#include "store/cache/cache_space.h"
#include "store/cache/resume_files.h"

namespace pounce {
namespace {

using store::CachedObject;
using store::CacheLayout;

constexpr std::uint64_t kLongestLabel = 4096;

FileSystem& disk() { return posix_file_system(); }

/// The folder that was named, or the default one.
std::string chosen(const std::string& folder) {
  const std::string root = folder.empty() ? default_cache_folder() : folder;
  if (root.empty()) {
    throw Error(
        ErrorKind::storage,
        "no cache folder: neither XDG_CACHE_HOME nor HOME is set; specify one with --cache");
  }
  // Never taken for an empty cache: somebody mistyped.
  const auto status = disk().status(root);
  if (status && !status->is_folder) {
    throw Error(ErrorKind::storage, root + ": is a file, not a cache folder");
  }
  return root;
}

double seconds(std::int64_t nanoseconds) { return static_cast<double>(nanoseconds) * 1e-9; }

/// What a pack was made of, by the word of the job that made it: nothing that anybody checks.
std::string label_text(const CachedObject& object) {
  if (object.label_path.empty()) return "";
  try {
    const auto file = disk().open(object.label_path);
    std::string text(std::min(file->size_bytes(), kLongestLabel), '\0');
    file->read(0, std::as_writable_bytes(std::span(text)));
    text.resize(std::min(text.find('\n'), text.size()));
    // Names of files may hold anything, and a label may be damaged: nothing for a terminal to obey.
    std::replace_if(
        text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c == 127; }, '?');
    return text;
  } catch (const Error&) {
    return "";  // it went with its pack
  }
}

CacheObject described(const CachedObject& object) {
  return {store::kind_name(object.kind),
          to_hex(object.key),
          object.path,
          label_text(object),
          object.size_bytes,
          seconds(object.last_used_ns)};
}

store::CacheScan scan(const std::string& folder) {
  return store::scan_cache(disk(), CacheLayout(chosen(folder)));
}

/// Runs `evict` on a cache that exists and says what it did.
template <class Evict>
CachePruned tidy(const std::string& folder, const Evict& evict) {
  return with_own_errors([&] {
    const CacheLayout layout(chosen(folder));
    CachePruned pruned;
    if (!disk().exists(layout.parts_folder())) return pruned;
    // Leftovers of dead processes first: they take space, for which packs would be evicted.
    store::remove_leftovers(disk(), layout);
    store::CacheSpace space(disk(), layout, 0, nullptr);
    evict(space, pruned);
    const store::RemovedFiles left = store::remove_noted_files(disk(), layout);
    pruned.half_done = left.files;
    pruned.half_done_bytes = left.bytes;
    // Counted again, not subtracted: jobs may have written meanwhile.
    pruned.taken_bytes = store::scan_cache(disk(), layout).total_bytes;
    return pruned;
  });
}

/// Packs that were in use stay, and are told: the next call finds them again.
void add(CachePruned& pruned, const store::Evicted& evicted) {
  pruned.objects += evicted.objects;
  pruned.bytes += evicted.bytes;
  pruned.in_use += evicted.in_use;
}

}  // namespace

std::string default_cache_folder() {
  const auto from = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr ? std::string(value) : std::string();
  };
  if (const std::string xdg = from("XDG_CACHE_HOME"); !xdg.empty()) return xdg + "/pounce";
  if (const std::string home = from("HOME"); !home.empty()) return home + "/.cache/pounce";
  return {};
}

std::vector<CacheObject> cache_list(const std::string& folder) {
  return with_own_errors([&] {
    std::vector<CacheObject> list;
    for (const CachedObject& object : scan(folder).objects) list.push_back(described(object));
    return list;
  });
}

CacheInfo cache_info(const std::string& folder) {
  return with_own_errors([&] {
    CacheInfo info;
    info.folder = chosen(folder);
    const store::CacheScan found = store::scan_cache(disk(), CacheLayout(info.folder));
    info.taken_bytes = found.total_bytes;
    info.default_limit_bytes = store::default_limit_bytes(disk(), info.folder);
    for (const CachedObject& object : found.objects) {
      CacheShare& share = info.kinds[store::kind_name(object.kind)];
      ++share.objects;
      share.bytes += object.size_bytes;
    }
    info.unfinished = {found.parts, found.part_bytes};
    return info;
  });
}

// Reads every byte of every pack, which is what a job would do that does not trust the cache. A
// pack that is damaged is made again by the next job that wants it, with or without `remove`.
CacheVerdict cache_verify(const std::string& folder, bool remove) {
  return with_own_errors([&] {
    CacheVerdict verdict;
    for (const CachedObject& object : scan(folder).objects) {
      // Held while it is read, so that no other process evicts it in the middle.
      auto file = disk().open_held(object.path);
      if (file == nullptr) continue;  // removed meanwhile
      ++verdict.objects;
      verdict.bytes += object.size_bytes;
      try {
        store::PackReader(std::move(file), object.path, object.kind, object.key).verify();
      } catch (const Error& e) {
        if (e.kind() != ErrorKind::damaged_store) throw;
        verdict.damaged.push_back({described(object), e.what(), remove});
        // The label goes with it; the next job that needs the pack makes it again.
        if (remove) {
          disk().remove(object.path);
          if (!object.label_path.empty()) disk().remove(object.label_path);
        }
      }
    }
    return verdict;
  });
}

// By age first, then by size: what is too old goes even where there is room for it.
CachePruned cache_prune(const std::string& folder, std::optional<std::uint64_t> most_bytes,
                        std::optional<double> older_than_s) {
  return tidy(folder, [&](store::CacheSpace& space, CachePruned& pruned) {
    if (older_than_s) {
      const auto now = std::chrono::system_clock::now().time_since_epoch();
      const double oldest = std::chrono::duration<double>(now).count() - *older_than_s;
      // Down to 0 bytes, but only of what is too old.
      add(pruned, space.evict(0, [&](const CachedObject& object) {
        return seconds(object.last_used_ns) < oldest;
      }));
    }
    if (most_bytes) {
      const store::Evicted more = space.evict(*most_bytes, nullptr);
      pruned.objects += more.objects;
      pruned.bytes += more.bytes;
      // Both passes met the same packs in use: they count once.
      pruned.in_use = std::max(pruned.in_use, more.in_use);
    }
  });
}

CachePruned cache_clear(const std::string& folder) {
  return tidy(folder, [](store::CacheSpace& space, CachePruned& pruned) {
    add(pruned, space.evict(0, nullptr));
    disk().remove(space.layout().hash_memo());
  });
}

}  // namespace pounce
