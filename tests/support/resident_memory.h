// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>

namespace pounce::test {

/// Peak resident bytes since the last reset, or 0 where the system does not tell.
inline std::uint64_t peak_rss() {
  std::FILE* file = std::fopen("/proc/self/status", "r");
  unsigned long long kilobytes = 0;
  char line[256];
  while (file != nullptr && std::fgets(line, sizeof line, file) != nullptr) {
    if (std::sscanf(line, "VmHWM: %llu", &kilobytes) == 1) break;
  }
  if (file != nullptr) std::fclose(file);
  return kilobytes << 10;
}

inline std::uint64_t reset_peak_rss() {
  if (std::FILE* file = std::fopen("/proc/self/clear_refs", "w")) {
    std::fputs("5", file);
    std::fclose(file);
  }
  return peak_rss();
}

}  // namespace pounce::test
