// SPDX-License-Identifier: Apache-2.0
#include "io/files/output_leftovers.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <map>
#include <mutex>
#include <string_view>
#include <system_error>
#include <utility>

namespace pounce::io {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kPause = 50;                    // listings' share of the time: 2 %
constexpr std::size_t kMostFolders = 64;      // remembered
constexpr std::size_t kMostLeftovers = 4096;  // of a folder; the next listing finds others

/// The NAME in ".NAME.<digits>-<digits>.tmp", or nothing.
std::string_view output_of(std::string_view entry) {
  constexpr std::string_view kEnding = ".tmp", kDigits = "0123456789";
  if (!entry.starts_with('.') || !entry.ends_with(kEnding)) return {};
  entry.remove_prefix(1);
  entry.remove_suffix(kEnding.size());
  for (const char before : {'-', '.'}) {
    const std::size_t last = entry.find_last_not_of(kDigits);
    if (last == std::string_view::npos || last + 1 == entry.size() || entry[last] != before)
      return {};
    entry = entry.substr(0, last);
  }
  return entry;
}

void remove_if_left(const std::string& path, uid_t owner) {
  constexpr int kHow = O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
  int file = ::open(path.c_str(), O_RDWR | kHow);
  // Reading is enough for a lock (but on NFS).
  if (file < 0 && errno == EACCES) file = ::open(path.c_str(), O_RDONLY | kHow);
  if (file < 0) return;
  struct stat opened {
  }, named{};
  const bool dead = ::fstat(file, &opened) == 0 && S_ISREG(opened.st_mode) &&
                    (opened.st_uid == ::geteuid() || opened.st_uid == owner) &&
                    ::flock(file, LOCK_EX | LOCK_NB) == 0 && ::lstat(path.c_str(), &named) == 0 &&
                    opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
  if (dead) ::unlink(path.c_str());
  ::close(file);
}

/// A folder's hidden files, by the outputs they were to become.
struct Listing {
  std::multimap<std::string, std::string, std::less<>> found;
  Clock::time_point end;
  Clock::duration took{};

  explicit Listing(const std::string& folder) {
    const Clock::time_point begin = Clock::now();
    std::error_code ignored;
    for (fs::directory_iterator entry(folder, ignored), end_entry; !ignored && entry != end_entry;
         entry.increment(ignored)) {
      const std::string name = entry->path().filename().string();
      if (const std::string_view output = output_of(name); !output.empty())
        found.emplace(output, name);
      if (found.size() == kMostLeftovers) break;
    }
    end = Clock::now();
    took = end - begin;
  }
};

}  // namespace

std::string claim_name(const std::string& name) { return "." + name + ".0-0.tmp"; }

void remove_leftovers(const std::string& folder, const std::string& name, uid_t owner) {
  static std::mutex mutex;
  static std::map<std::pair<dev_t, ino_t>, Listing> listings;
  struct stat status {};
  if (::stat(folder.c_str(), &status) != 0) return;
  const std::lock_guard lock(mutex);
  const std::pair key{status.st_dev, status.st_ino};
  auto known = listings.find(key);
  if (known != listings.end() && Clock::now() - known->second.end > kPause * known->second.took)
    known = (listings.erase(known), listings.end());
  if (known == listings.end()) {
    if (listings.size() == kMostFolders) listings.clear();
    known = listings.emplace(key, Listing(folder)).first;
  }
  auto& found = known->second.found;
  const auto [begin, end] = found.equal_range(name);
  for (auto entry = begin; entry != end; ++entry)
    remove_if_left((fs::path(folder) / entry->second).string(), owner);
  found.erase(begin, end);
}

}  // namespace pounce::io
