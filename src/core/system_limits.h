// SPDX-License-Identifier: Apache-2.0
//
// What the system lets this process have: memory and threads.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace pounce {

/// How much memory this process may use, in bytes, and what says so.
struct UsableMemory {
  std::uint64_t bytes = 0;
  std::string limited_by;  ///< "physical memory", "cgroup", "address space limit", "data limit"
};

/// The least of: physical memory, the memory limits of this process's control groups and of all
/// groups above them (v2 memory.max, v1 memory.limit_in_bytes), and what RLIMIT_AS and RLIMIT_DATA
/// leave beside what the process took already (libraries, above all). What cannot be read does not
/// limit. `system_root` stands in front of /proc and /sys, for tests.
UsableMemory usable_memory(const std::string& system_root = {});

/// A limit on what this process takes of memory: beyond a control group's it is killed, beyond one
/// of its own it gets no more.
struct MemoryLimit {
  std::uint64_t bytes = 0;
  std::uint64_t taken_bytes = 0;  ///< of it, by this process, now
  bool kills = false;
  std::string name;  ///< for messages, with the file or the command that sets it
};

/// The least limit of the control groups, then RLIMIT_AS and RLIMIT_DATA; only those that there
/// are. Of a control group what is taken counts without copies of files (code of the program and
/// its libraries): the kernel drops these where memory is short.
std::vector<MemoryLimit> memory_limits(const std::string& system_root = {});

/// What this process has of memory now that no file holds: heap, stacks, data of libraries, and the
/// page tables of all of it. 0 where the system does not say.
std::uint64_t anonymous_bytes(const std::string& system_root = {});

/// The size of the huge pages that this process gets for memory that it asks them for
/// (MADV_HUGEPAGE); 0 if it gets none.
std::uint64_t huge_page_bytes(const std::string& system_root = {});

/// The largest file that this process may write (RLIMIT_FSIZE); UINT64_MAX without a limit.
std::uint64_t largest_file_bytes();

/// How many threads of `wanted`, the calling one included, this process may have at once. They are
/// started and ended again: what a thread pool does when it gets fewer than it counts on is not for
/// us to say.
unsigned obtainable_threads(unsigned wanted);

}  // namespace pounce
