// SPDX-License-Identifier: Apache-2.0
#include "core/system_memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>
#include <sstream>

namespace pounce {
namespace {

constexpr std::uint64_t kNoLimit = std::numeric_limits<std::uint64_t>::max();

std::uint64_t physical_bytes() {
  const long pages = ::sysconf(_SC_PHYS_PAGES);
  const long page_bytes = ::sysconf(_SC_PAGE_SIZE);
  if (pages <= 0 || page_bytes <= 0) return kNoLimit;
  return static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page_bytes);
}

std::uint64_t resource_limit(decltype(RLIMIT_AS) resource) {
  rlimit limit{};
  if (::getrlimit(resource, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kNoLimit;
  return limit.rlim_cur;
}

/// The number in a file of one line; no limit if it says "max" or is not there.
std::uint64_t limit_in(const std::string& path) {
  std::ifstream file(path);
  std::string text;
  if (!(file >> text)) return kNoLimit;
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? value : kNoLimit;
}

/// The least limit of `group` and of the groups above it. Inside a container the group's path may
/// be the host's and missing here; the walk upwards then ends at the container's own root.
std::uint64_t least_limit(const std::string& mount, std::string group, const std::string& file) {
  std::uint64_t least = kNoLimit;
  while (!group.empty() && group.back() == '/') group.pop_back();
  for (;;) {
    least = std::min(least, limit_in(mount + group + file));
    const std::size_t slash = group.rfind('/');
    if (slash == std::string::npos) return least;
    group.resize(slash);
  }
}

/// Bytes of the process's address space (field 0) or data (field 5) that are taken already.
std::uint64_t taken_bytes(const std::string& system_root, int field) {
  std::ifstream file(system_root + "/proc/self/statm");
  std::uint64_t pages = 0;
  for (int i = 0; i <= field; ++i) {
    if (!(file >> pages)) return 0;
  }
  return pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGE_SIZE));
}

/// What a limit of the process leaves to it: libraries alone take hundreds of MiB of address space.
std::uint64_t left_of(std::uint64_t limit, std::uint64_t taken) {
  return limit == kNoLimit ? kNoLimit : limit - std::min(limit, taken);
}

bool lists_memory(const std::string& controllers) {
  std::stringstream list(controllers);
  for (std::string name; std::getline(list, name, ',');) {
    if (name == "memory") return true;
  }
  return false;
}

/// Each line of /proc/self/cgroup is "number:controllers:path"; version 2 has number 0 and no
/// controllers.
std::uint64_t cgroup_limit(const std::string& system_root) {
  const std::string mounts = system_root + "/sys/fs/cgroup";
  std::ifstream file(system_root + "/proc/self/cgroup");
  std::uint64_t least = kNoLimit;
  for (std::string line; std::getline(file, line);) {
    const std::size_t first = line.find(':');
    const std::size_t second = first == std::string::npos ? first : line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const std::string group = line.substr(second + 1);
    if (controllers.empty()) {
      least = std::min(least, least_limit(mounts, group, "/memory.max"));
      least = std::min(least, least_limit(mounts + "/unified", group, "/memory.max"));
    } else if (lists_memory(controllers)) {
      least = std::min(least, least_limit(mounts + "/memory", group, "/memory.limit_in_bytes"));
    }
  }
  return least;
}

}  // namespace

UsableMemory usable_memory(const std::string& system_root) {
  UsableMemory usable{physical_bytes(), "physical memory"};
  const auto apply = [&](std::uint64_t limit, const char* name) {
    if (limit < usable.bytes) usable = {limit, name};
  };
  apply(cgroup_limit(system_root), "cgroup");
  apply(left_of(resource_limit(RLIMIT_AS), taken_bytes(system_root, 0)), "address space limit");
  apply(left_of(resource_limit(RLIMIT_DATA), taken_bytes(system_root, 5)), "data limit");
  return usable;
}

}  // namespace pounce
