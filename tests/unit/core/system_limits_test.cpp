// SPDX-License-Identifier: Apache-2.0
#include "core/system_limits.h"

#include <sys/prctl.h>
#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <vector>

#include "support/test_data.h"

namespace pounce {
namespace {

constexpr std::uint64_t kMiB = 1u << 20;

/// A folder with the files of /proc and /sys that matter.
struct FakeSystem {
  test::TempFolder folder;
  std::string root() const { return folder.path().string(); }
  void put(const std::string& path, const std::string& text) const {
    std::filesystem::create_directories((folder.path() / path).parent_path());
    std::ofstream(folder.path() / path) << text;
  }
};

TEST_CASE("without other limits the machine's memory is the limit", "[core]") {
  const FakeSystem system;
  const UsableMemory usable = usable_memory(system.root());
  std::ifstream info("/proc/meminfo");
  std::string label;
  std::uint64_t total_kib = 0;
  info >> label >> total_kib;
  REQUIRE(label == "MemTotal:");
  CHECK(usable.bytes <= total_kib * 1024);
  if (usable.limited_by == "physical memory") CHECK(usable.bytes == total_kib * 1024);
}

TEST_CASE("huge pages are those that memory gets on request", "[core]") {
  const std::string folder = "sys/kernel/mm/transparent_hugepage/";
  const FakeSystem system;
  const auto bytes = [&] { return huge_page_bytes(system.root()); };
  const int was_without = prctl(PR_GET_THP_DISABLE, 0, 0, 0, 0);
  REQUIRE(prctl(PR_SET_THP_DISABLE, 0, 0, 0, 0) == 0);
  CHECK(bytes() == 0);  // a system that does not say
  system.put(folder + "hpage_pmd_size", "2097152\n");
  CHECK(bytes() == 0);
  system.put(folder + "enabled", "always madvise [never]\n");
  CHECK(bytes() == 0);
  system.put(folder + "enabled", "always [madvise] never\n");
  CHECK(bytes() == 2 * kMiB);
  system.put(folder + "enabled", "[always] madvise never\n");
  CHECK(bytes() == 2 * kMiB);
  // Of this size alone.
  system.put(folder + "hugepages-2048kB/enabled", "always inherit madvise [never]\n");
  CHECK(bytes() == 0);
  system.put(folder + "hugepages-2048kB/enabled", "always [inherit] madvise never\n");
  CHECK(bytes() == 2 * kMiB);
  system.put(folder + "enabled", "always madvise [never]\n");
  CHECK(bytes() == 0);
  system.put(folder + "hugepages-2048kB/enabled", "always inherit [madvise] never\n");
  CHECK(bytes() == 2 * kMiB);
  // Of a process that is to have none.
  REQUIRE(prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0) == 0);
  CHECK(bytes() == 0);
  REQUIRE(prctl(PR_SET_THP_DISABLE, was_without & 1, was_without & 2, 0, 0) == 0);
}

TEST_CASE("a version 2 control group limits, and so do those above it", "[core]") {
  const FakeSystem system;
  system.put("proc/self/cgroup", "0::/user.slice/job.scope\n");
  system.put("sys/fs/cgroup/user.slice/job.scope/memory.max", "209715200\n");
  CHECK(usable_memory(system.root()).bytes == 200 * kMiB);
  CHECK(usable_memory(system.root()).limited_by == "cgroup");
  system.put("sys/fs/cgroup/user.slice/memory.max", "104857600\n");
  CHECK(usable_memory(system.root()).bytes == 100 * kMiB);
  system.put("sys/fs/cgroup/user.slice/job.scope/memory.max", "max\n");
  CHECK(usable_memory(system.root()).bytes == 100 * kMiB);
}

TEST_CASE("a version 1 control group limits, beside groups of other controllers", "[core]") {
  const FakeSystem system;
  system.put("proc/self/cgroup", "7:cpu,cpuacct:/tiny\n4:hugetlb,memory:/job\n0::/\n");
  system.put("sys/fs/cgroup/memory/tiny/memory.limit_in_bytes", "1048576\n");
  system.put("sys/fs/cgroup/memory/job/memory.limit_in_bytes", "314572800\n");
  system.put("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  CHECK(usable_memory(system.root()).bytes == 300 * kMiB);
}

TEST_CASE("inside a container the group's path on the host is not needed", "[core]") {
  const FakeSystem system;
  system.put("proc/self/cgroup", "4:memory:/docker/0123abcd\n");
  system.put("sys/fs/cgroup/memory/memory.limit_in_bytes", "419430400\n");
  CHECK(usable_memory(system.root()).bytes == 400 * kMiB);
}

TEST_CASE("version 2 groups are found where both versions are mounted", "[core]") {
  const FakeSystem system;
  system.put("proc/self/cgroup", "0::/a/b\n");
  system.put("sys/fs/cgroup/unified/a/memory.max", "52428800\n");
  CHECK(usable_memory(system.root()).bytes == 50 * kMiB);
}

TEST_CASE("groups are where mountinfo says, below the group at the root of the mount", "[core]") {
  const FakeSystem system;
  system.put("proc/self/cgroup", "4:memory:/docker/0123/job\n0::/docker/0123/job\n");
  system.put("proc/self/mountinfo",
             "30 22 0:27 / /sys/fs/cgroup rw - tmpfs tmpfs rw,mode=755\n"
             "33 30 0:30 /docker/0123 /sys/fs/cgroup/cpu rw,relatime - cgroup cgroup rw,cpu\n"
             "34 30 0:31 /docker/0123 /groups/mem rw master:3 - cgroup cgroup rw,memory\n"
             "40 30 0:37 / /groups/two rw - cgroup2 cgroup2 rw\n");
  system.put("groups/mem/job/memory.limit_in_bytes", "209715200\n");
  CHECK(usable_memory(system.root()).bytes == 200 * kMiB);
  system.put("groups/mem/memory.limit_in_bytes", "104857600\n");
  CHECK(usable_memory(system.root()).bytes == 100 * kMiB);
  system.put("groups/two/docker/memory.max", "52428800\n");
  CHECK(usable_memory(system.root()).bytes == 50 * kMiB);
  // Where groups are by habit there are none of these.
  system.put("sys/fs/cgroup/memory/job/memory.limit_in_bytes", "1048576\n");
  CHECK(usable_memory(system.root()).bytes == 50 * kMiB);
}

TEST_CASE("what no file holds is what a control group cannot take back", "[core]") {
  const FakeSystem system;
  CHECK(anonymous_bytes(system.root()) == 0);
  system.put("proc/self/status",
             "Name:\tpounce\nVmRSS:\t  140000 kB\nRssAnon:\t   40000 kB\nRssFile:\t   99000 kB\n"
             "RssShmem:\t    1000 kB\nVmPTE:\t     500 kB\n");
  CHECK(anonymous_bytes(system.root()) == (40000 + 1000 + 500) * 1024);
}

TEST_CASE("the limits of a process say where they come from", "[core]") {
  const FakeSystem system;
  const std::size_t own = memory_limits(system.root()).size();  // ulimit, where tests run
  system.put("proc/self/cgroup", "4:memory:/a/b\n");
  system.put("proc/self/status", "RssAnon:\t2048 kB\n");
  system.put("sys/fs/cgroup/memory/a/memory.limit_in_bytes", "52428800\n");
  system.put("sys/fs/cgroup/memory/a/b/memory.limit_in_bytes", "9223372036854771712\n");
  const std::vector<MemoryLimit> limits = memory_limits(system.root());
  REQUIRE(limits.size() == own + 1);
  CHECK(limits[0].bytes == 50 * kMiB);
  CHECK(limits[0].taken_bytes == 2 * kMiB);
  CHECK(limits[0].kills);
  CHECK(limits[0].name ==
        "the memory limit of the control group (/sys/fs/cgroup/memory/a/memory.limit_in_bytes)");
}

TEST_CASE("files that say nothing sensible do not limit", "[core]") {
  const FakeSystem none, strange;
  strange.put("proc/self/cgroup", "nonsense\n0:\n:::\n0::/a\n");
  strange.put("sys/fs/cgroup/a/memory.max", "12 apples? no: -1");
  strange.put("sys/fs/cgroup/memory.max", "0x10\n");
  strange.put("sys/fs/cgroup/a/memory.max", "\n");
  CHECK(usable_memory(strange.root()).bytes == usable_memory(none.root()).bytes);
}

TEST_CASE("a limit of the process's data is a limit", "[core]") {
  const FakeSystem system;
  rlimit before{};
  ::getrlimit(RLIMIT_DATA, &before);
  const std::uint64_t bytes = 1000 * kMiB;
  if (before.rlim_max < bytes || usable_memory(system.root()).bytes <= bytes) return;
  const rlimit limit{bytes, before.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_DATA, &limit) == 0);
  const UsableMemory usable = usable_memory(system.root());
  ::setrlimit(RLIMIT_DATA, &before);
  CHECK(usable.bytes == bytes);
  CHECK(usable.limited_by == "data limit");
  // Of it, 300 MiB are taken: size, resident, shared, text, library, data, dirty; in pages.
  system.put("proc/self/statm", "200000 1 1 1 0 76800 0\n");
  REQUIRE(::setrlimit(RLIMIT_DATA, &limit) == 0);
  const UsableMemory rest = usable_memory(system.root());
  ::setrlimit(RLIMIT_DATA, &before);
  CHECK(rest.bytes == bytes - 300 * kMiB);
}

TEST_CASE("a limit of the size of files is known", "[core]") {
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit{std::min<rlim_t>(before.rlim_max, 1000 * kMiB), before.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &limit) == 0);
  const std::uint64_t bytes = largest_file_bytes();
  ::setrlimit(RLIMIT_FSIZE, &before);
  CHECK(bytes == limit.rlim_cur);
}

}  // namespace
}  // namespace pounce
