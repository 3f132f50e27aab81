// SPDX-License-Identifier: Apache-2.0
#include "core/scratch_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <set>
#include <string_view>
#include <utility>

namespace pounce {
namespace {

constexpr std::string_view kPrefix = ".pounce-", kRandom = "XXXXXX";

/// As mkostemp() makes them.
bool is_scratch_name(std::string_view name) {
  const auto is_letter = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
  };
  return name.size() == kPrefix.size() + kRandom.size() && name.starts_with(kPrefix) &&
         std::all_of(name.begin() + kPrefix.size(), name.end(), is_letter);
}

int close_folder(DIR* folder) { return folder == nullptr ? 0 : ::closedir(folder); }

/// Removes empty files of such names that are this user's. One may be of a process that is about to
/// remove it itself: it has the file open and misses nothing. Once per folder and process: a folder
/// may have a million files. Failures do not matter.
void remove_left_scratch(const std::string& folder) {
  static std::mutex mutex;
  static std::set<std::pair<dev_t, ino_t>> seen;
  const std::unique_ptr<DIR, int (*)(DIR*)> stream(::opendir(folder.c_str()), close_folder);
  struct stat status {};
  if (!stream || ::fstat(::dirfd(stream.get()), &status) != 0) return;
  const std::lock_guard lock(mutex);
  if (!seen.insert({status.st_dev, status.st_ino}).second) return;
  while (const dirent* entry = ::readdir(stream.get())) {
    struct stat file {};
    if (!is_scratch_name(entry->d_name) ||
        ::fstatat(::dirfd(stream.get()), entry->d_name, &file, AT_SYMLINK_NOFOLLOW) != 0)
      continue;
    if (S_ISREG(file.st_mode) && file.st_size == 0 && file.st_uid == ::geteuid())
      ::unlinkat(::dirfd(stream.get()), entry->d_name, 0);
  }
}

}  // namespace

int open_scratch_file(const std::string& folder) {
  int file = -1;
  do {
    file = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_EXCL | O_CLOEXEC, 0600);
  } while (file < 0 && errno == EINTR);
  if (file >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL)) return file;
  remove_left_scratch(folder);
  std::string path = folder + "/" + std::string(kPrefix) + std::string(kRandom);
  file = ::mkostemp(path.data(), O_CLOEXEC);
  if (file >= 0) ::unlink(path.c_str());
  return file;
}

}  // namespace pounce
