// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

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

}  // namespace pounce
