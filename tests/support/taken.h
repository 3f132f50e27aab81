// SPDX-License-Identifier: Apache-2.0
//
// What a piece of work takes, measured in a process of its own: what others left in memory would be
// used again by it.
#pragma once

#include <malloc.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <fstream>
#include <functional>
#include <string>

#include "pounce/error.h"

namespace pounce::test {

/// What a piece of work took: status 0, or the kind of the Error that it threw.
struct Taken {
  int status = 0;
  double cpu_s = 0;
  std::uint64_t grown_bytes = 0;  ///< of the resident memory, at its peak
};

/// A line of /proc/self/status, such as "VmHWM", in bytes.
inline std::uint64_t own_memory(const std::string& name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(name + ":", 0) == 0) return std::stoull(line.substr(name.size() + 1)) * 1024;
  }
  return 0;
}

/// In the child: the kind of Error that `work` throws, 0 for none.
inline int status_of(const std::function<void()>& work) {
  try {
    work();
    return 0;
  } catch (const Error& e) {
    return exit_status(e.kind());
  } catch (...) {
    return 99;
  }
}

inline Taken taken_by(const std::function<void()>& work) {
  std::array<int, 2> pipe{};
  REQUIRE(::pipe(pipe.data()) == 0);
  ::malloc_trim(0);  // or the child would use again what the parent let go
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    const rlimit seconds{60, 60};
    ::setrlimit(RLIMIT_CPU, &seconds);
    const std::uint64_t before = own_memory("RssAnon");
    const int result = status_of(work);
    // Pages of programs and files are no memory of the job's.
    const std::uint64_t peak = own_memory("VmHWM") - own_memory("RssFile");
    const std::uint64_t grown = peak > before ? peak - before : 0;
    const bool told = ::write(pipe[1], &grown, sizeof grown) == sizeof grown;
    ::_exit(told ? result : 98);
  }
  ::close(pipe[1]);
  Taken taken;
  const bool told =
      ::read(pipe[0], &taken.grown_bytes, sizeof taken.grown_bytes) == sizeof taken.grown_bytes;
  ::close(pipe[0]);
  int status = 0;
  rusage usage{};
  REQUIRE(::wait4(child, &status, 0, &usage) == child);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  taken.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  taken.status = told && WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  return taken;
}

}  // namespace pounce::test
