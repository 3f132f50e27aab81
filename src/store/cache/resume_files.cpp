// SPDX-License-Identifier: Apache-2.0
#include "store/cache/resume_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "pounce/error.h"

namespace pounce::store {
namespace {

constexpr std::string_view kPrefix = ".pounce-", kSuffix = ".resume";
constexpr std::uint64_t kLongestPath = 4096;

bool is_resume_name(const std::string& name) {
  return name.starts_with(kPrefix) && name.ends_with(kSuffix) &&
         name.size() == kPrefix.size() + 32 + kSuffix.size();
}

std::string notes_folder(const CacheLayout& layout) { return layout.folder() + "/resume"; }

/// What of this may fail (a folder that is gone, or of another user) is no reason to stop.
template <class Step>
void try_to(const Step& step) {
  try {
    step();
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::storage) throw;
  }
}

}  // namespace

std::string resume_name(const Hash128& key) {
  return fmt::format("{}{}{}", kPrefix, to_hex(key), kSuffix);
}

bool has_resume_files(FileSystem& files, const std::string& folder) {
  bool found = false;
  try_to([&] {
    const std::vector<std::string> names = files.list(folder);
    found = std::any_of(names.begin(), names.end(), is_resume_name);
  });
  return found;
}

RemovedFiles remove_resume_files(FileSystem& files, const std::string& folder,
                                 std::int64_t oldest_ns) {
  RemovedFiles removed;
  const auto now = std::chrono::duration_cast<std::chrono::nanoseconds>(
                       std::chrono::system_clock::now().time_since_epoch())
                       .count();
  for (const std::string& name : files.list(folder)) {
    if (!is_resume_name(name)) continue;
    const std::string path = (std::filesystem::path(folder) / name).string();
    const auto status = files.status(path);
    if (!status || now - status->modified_ns < oldest_ns) continue;
    // Whoever can open it so has it alone: nobody goes on with it meanwhile.
    const auto file = files.reopen_resumable(path);
    if (file == nullptr) continue;
    removed.bytes += file->size_bytes();
    ++removed.files;
    file->forget();
  }
  return removed;
}

void note_resume_folder(FileSystem& files, const CacheLayout& layout, const std::string& folder) {
  try_to([&] {
    Hasher hasher;
    hasher.add(std::string_view(folder));
    const std::string note = notes_folder(layout) + "/" + to_hex(hasher.digest());
    if (files.exists(note)) return;
    files.make_folders(notes_folder(layout));
    const auto file = files.create_private(note);
    if (file == nullptr) return;
    file->append(std::as_bytes(std::span(folder)));
    file->sync();
  });
}

RemovedFiles remove_noted_files(FileSystem& files, const CacheLayout& layout) {
  RemovedFiles removed;
  const std::string notes = notes_folder(layout);
  if (!files.exists(notes)) return removed;
  for (const std::string& name : files.list(notes)) {
    const std::string note = notes + "/" + name;
    try_to([&] {
      // Another user's could name any folder.
      const auto file = files.open_private(note);
      if (file == nullptr || file->size_bytes() > kLongestPath) return;
      std::string folder(file->size_bytes(), '\0');
      file->read(0, std::as_writable_bytes(std::span(folder)));
      if (files.exists(folder)) {
        const RemovedFiles here = remove_resume_files(files, folder, 0);
        removed.files += here.files;
        removed.bytes += here.bytes;
      }
      files.remove(note);
    });
  }
  return removed;
}

}  // namespace pounce::store
