// SPDX-License-Identifier: Apache-2.0
#include "store/cache/cache_layout.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <tuple>

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
  }
  throw Error(ErrorKind::internal, "a pack of no kind (please report)");
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
  return to_hex(key) == text ? std::optional(key) : std::nullopt;
}

}  // namespace pounce::store
