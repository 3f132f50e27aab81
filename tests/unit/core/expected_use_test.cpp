// SPDX-License-Identifier: Apache-2.0
//
// Of a pool of which nothing is in use: a program of its own, since others leave memory there.
#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstring>
#include <vector>

#include "core/page_pool.h"
#include "core/system_limits.h"

using namespace pounce;

TEST_CASE("what is expected to be in use is faulted in by huge pages") {
  constexpr std::size_t kBytes = 3 * kPageBytes, kCount = 300;
  const auto faults = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_minflt;
  };
  std::vector<void*> buffers(kCount);
  const auto before = faults();
  {
    const ExpectedUse expected(std::size_t{2} << 20);
    for (void*& buffer : buffers) {
      buffer = PagePool::instance().allocate(kBytes);
      std::memset(buffer, 1, kBytes);
    }
  }
  const auto taken = faults() - before;
  for (void* const buffer : buffers) PagePool::instance().release(buffer, kBytes);
  if (huge_page_bytes() != std::size_t{2} << 20) {
    std::puts("SKIPPED: huge pages (the system has none)");
  } else {
    CHECK(taken < 100);  // of 900 pages
  }
}
