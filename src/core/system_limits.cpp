// SPDX-License-Identifier: Apache-2.0
//
// Whoever takes more memory than a control group allows is killed without a word, so a budget must
// fit what every group above this process allows. There is no call that says that number: it stands
// in a file of each group, in one of two forms (v1, v2), under a mount point that differs, along a
// path that inside a container may be the host's. So the walk goes from the process's own group to
// the root and takes the least; what cannot be read does not limit.
//
// Without any of these files, as in a sandbox, the machine's memory is the limit. All paths may be
// below another root, so that tests can present other machines.
#include "core/system_limits.h"

#include <pthread.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace pounce {
namespace {

constexpr std::uint64_t kNoLimit = std::numeric_limits<std::uint64_t>::max();

// Not what is free: that changes while a job runs, and most of what is "used" is cached files.
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

struct GroupLimit {
  std::uint64_t bytes = kNoLimit;
  std::string file;  ///< that says so
};

/// Where the groups of a hierarchy are, and which of them is at its root.
struct GroupMount {
  std::string folder, root;
  bool is_v2 = false;
};

bool lists_memory(const std::string& controllers) {
  std::stringstream list(controllers);
  for (std::string name; std::getline(list, name, ',');) {
    if (name == "memory") return true;
  }
  return false;
}

/// Of /proc/self/mountinfo, whose lines are "id parent device root folder options [more] - type
/// device options"; the usual places where it names none.
std::vector<GroupMount> group_mounts(const std::string& system_root) {
  std::vector<GroupMount> mounts;
  std::ifstream file(system_root + "/proc/self/mountinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t middle = line.find(" - ");
    if (middle == std::string::npos) continue;
    std::istringstream before(line.substr(0, middle)), after(line.substr(middle + 3));
    std::string skipped, type, options;
    GroupMount mount;
    before >> skipped >> skipped >> skipped >> mount.root >> mount.folder;
    after >> type >> skipped >> options;
    mount.is_v2 = type == "cgroup2";
    if (mount.is_v2 || (type == "cgroup" && lists_memory(options))) mounts.push_back(mount);
  }
  if (mounts.empty()) {
    mounts = {{"/sys/fs/cgroup", "/", true},
              {"/sys/fs/cgroup/unified", "/", true},
              {"/sys/fs/cgroup/memory", "/", false}};
  }
  return mounts;
}

/// The least limit of `group` and of the groups above it. Inside a container the group's path may
/// be the host's and missing here; the walk upwards then ends at the container's own root.
void apply_groups(const std::string& system_root, const GroupMount& mount, std::string group,
                  GroupLimit& least) {
  if (mount.root != "/" && (group + "/").starts_with(mount.root + "/"))
    group.erase(0, mount.root.size());
  while (!group.empty() && group.back() == '/') group.pop_back();
  for (;;) {
    const std::string file =
        mount.folder + group + (mount.is_v2 ? "/memory.max" : "/memory.limit_in_bytes");
    // A group may allow more than the groups above it; only the least of all counts.
    if (const std::uint64_t bytes = limit_in(system_root + file); bytes < least.bytes)
      least = {bytes, file};
    const std::size_t slash = group.rfind('/');
    if (slash == std::string::npos) return;
    group.resize(slash);
  }
}

/// Each line of /proc/self/cgroup is "number:controllers:path"; version 2 has number 0 and no
/// controllers.
GroupLimit cgroup_limit(const std::string& system_root) {
  const std::vector<GroupMount> mounts = group_mounts(system_root);
  std::ifstream file(system_root + "/proc/self/cgroup");
  GroupLimit least;
  for (std::string line; std::getline(file, line);) {
    const std::size_t first = line.find(':');
    const std::size_t second = first == std::string::npos ? first : line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    if (!controllers.empty() && !lists_memory(controllers)) continue;
    for (const GroupMount& mount : mounts) {
      if (mount.is_v2 == controllers.empty())
        apply_groups(system_root, mount, line.substr(second + 1), least);
    }
  }
  return least;
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

}  // namespace

UsableMemory usable_memory(const std::string& system_root) {
  UsableMemory usable{physical_bytes(), "physical memory"};
  const auto apply = [&](std::uint64_t limit, const char* name) {
    if (limit < usable.bytes) usable = {limit, name};
  };
  // Limits of the process are compared less what it has taken already. A group's is compared as a
  // whole: most of what it has used may be cached files, which give way.
  apply(cgroup_limit(system_root).bytes, "cgroup");
  apply(left_of(resource_limit(RLIMIT_AS), taken_bytes(system_root, 0)), "address space limit");
  apply(left_of(resource_limit(RLIMIT_DATA), taken_bytes(system_root, 5)), "data limit");
  return usable;
}

std::vector<MemoryLimit> memory_limits(const std::string& system_root) {
  std::vector<MemoryLimit> limits;
  // Only what is below the machine's memory is a limit in a user's eyes.
  // A group without limit of version 1 says a number that no machine has.
  if (const GroupLimit group = cgroup_limit(system_root); group.bytes < physical_bytes()) {
    limits.push_back({group.bytes, anonymous_bytes(system_root), true,
                      "the memory limit of the control group (" + group.file + ")"});
  }
  const auto add = [&](decltype(RLIMIT_AS) resource, int field, const char* name) {
    const std::uint64_t bytes = resource_limit(resource);
    if (bytes != kNoLimit) limits.push_back({bytes, taken_bytes(system_root, field), false, name});
  };
  add(RLIMIT_AS, 0, "the address space limit (ulimit -v)");
  add(RLIMIT_DATA, 5, "the data limit (ulimit -d)");
  return limits;
}

std::uint64_t anonymous_bytes(const std::string& system_root) {
  // Page tables count as well: of 64 GiB they are 128 MiB, and the group is charged for them.
  std::ifstream file(system_root + "/proc/self/status");
  std::uint64_t bytes = 0;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string name;
    std::uint64_t kib = 0;
    words >> name;
    if ((name == "RssAnon:" || name == "RssShmem:" || name == "VmPTE:") && words >> kib)
      bytes += kib * 1024;
  }
  return bytes;
}

std::uint64_t huge_page_bytes(const std::string& system_root) {
  // 3, from Linux 6.18 on: disabled, but not where they are asked for.
  if (::prctl(PR_GET_THP_DISABLE, 0, 0, 0, 0) == 1) return 0;
  const std::string folder = system_root + "/sys/kernel/mm/transparent_hugepage/";
  const std::uint64_t bytes = limit_in(folder + "hpage_pmd_size");
  // Of choices the one that holds is in brackets. Newer systems have one for each size, too.
  const auto chosen = [](const std::string& file, const std::string& choice) {
    std::ifstream choices(file);
    std::string text;
    return std::getline(choices, text) && text.find('[' + choice + ']') != std::string::npos;
  };
  const auto allowed = [&](const std::string& file) {
    return chosen(file, "always") || chosen(file, "madvise");
  };
  const std::string own = folder + "hugepages-" + std::to_string(bytes / 1024) + "kB/enabled";
  const bool has_own = std::ifstream(own).is_open() && !chosen(own, "inherit");
  return bytes != kNoLimit && allowed(has_own ? own : folder + "enabled") ? bytes : 0;
}

std::uint64_t largest_file_bytes() { return resource_limit(RLIMIT_FSIZE); }

unsigned obtainable_threads(unsigned wanted) {
  // By trying, all at the same time: limits are per user, per group and per system, and what others
  // have of them is not to be read.
  std::mutex gate;  // holds the threads until all of them are there
  std::vector<pthread_t> threads;
  threads.reserve(wanted);
  {
    const std::lock_guard closed(gate);
    const auto wait = [](void* opaque) -> void* {
      const std::lock_guard passed(*static_cast<std::mutex*>(opaque));
      return nullptr;
    };
    pthread_t thread;
    while (threads.size() + 1 < wanted && pthread_create(&thread, nullptr, wait, &gate) == 0)
      threads.push_back(thread);
  }
  for (const pthread_t thread : threads) pthread_join(thread, nullptr);
  return static_cast<unsigned>(threads.size()) + 1;
}

}  // namespace pounce
