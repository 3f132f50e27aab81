// SPDX-License-Identifier: Apache-2.0
#include "core/page_pool.h"

#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/random.h"

using namespace pounce;
using pounce::test::Random;

namespace {

std::size_t resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t whole = 0, resident = 0;
  statm >> whole >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

/// Bytes of this process in anonymous huge pages; 0 where the system does not say.
std::size_t huge_bytes() {
  std::ifstream rollup("/proc/self/smaps_rollup");
  std::size_t kib = 0;
  for (std::string word; rollup >> word;)
    if (word == "AnonHugePages:" && rollup >> kib) return kib * 1024;
  return 0;
}

struct Buffer {
  std::uint64_t* at = nullptr;
  std::size_t bytes = 0;
  std::uint64_t mark = 0;
};

/// A few words of each page: all that could belong to somebody else.
void fill(const Buffer& buffer) {
  for (std::size_t at = 0; at + 8 <= buffer.bytes; at += 1024) buffer.at[at / 8] = buffer.mark ^ at;
}
bool intact(const Buffer& buffer) {
  for (std::size_t at = 0; at + 8 <= buffer.bytes; at += 1024) {
    if (buffer.at[at / 8] != (buffer.mark ^ at)) return false;
  }
  return true;
}

/// Allocates and releases at random; returns whether every buffer kept what was written to it.
bool churn(std::uint64_t seed) {
  Random random(seed);
  std::vector<Buffer> buffers;
  bool good = true;
  for (int step = 0; step < 4000; ++step) {
    if (buffers.size() > 60 || (!buffers.empty() && random.one_in(2))) {
      const std::size_t i = random.below(buffers.size());
      good = good && intact(buffers[i]);
      PagePool::instance().release(buffers[i].at, buffers[i].bytes);
      buffers[i] = buffers.back();
      buffers.pop_back();
      continue;
    }
    Buffer buffer;
    const std::uint64_t largest = random.one_in(100)  ? 12 << 20
                                  : random.one_in(10) ? 1 << 20
                                                      : 1 << 15;
    buffer.bytes = 1 + random.below(largest);
    buffer.at = static_cast<std::uint64_t*>(PagePool::instance().allocate(buffer.bytes));
    buffer.mark = random.bits();
    good = good && reinterpret_cast<std::uintptr_t>(buffer.at) % kPageBytes == 0;
    fill(buffer);
    buffers.push_back(buffer);
  }
  for (const Buffer& buffer : buffers) {
    good = good && intact(buffer);
    PagePool::instance().release(buffer.at, buffer.bytes);
  }
  return good;
}

}  // namespace

TEST_CASE("buffers of several threads never overlap and keep what is in them") {
  std::atomic<int> good = 0;
  std::vector<std::thread> threads;
  for (std::uint64_t seed = 1; seed <= 4; ++seed)
    threads.emplace_back([&good, seed] { good += churn(seed) ? 1 : 0; });
  for (std::thread& thread : threads) thread.join();
  CHECK(good == 4);
}

TEST_CASE("what is released goes back to the system, all but a few MiB") {
  constexpr std::size_t kSlack = 24 << 20;
  churn(9);
  const std::size_t before = resident_bytes();
  for (const std::size_t buffer_bytes :
       {std::size_t{5000}, std::size_t{300000}, std::size_t{3} << 20, std::size_t{20} << 20}) {
    std::vector<Buffer> buffers;
    for (std::size_t total = 0; total < std::size_t{160} << 20;
         total += round_to_pages(buffer_bytes)) {
      Buffer buffer{nullptr, buffer_bytes, total};
      buffer.at = static_cast<std::uint64_t*>(PagePool::instance().allocate(buffer_bytes));
      fill(buffer);
      buffers.push_back(buffer);
    }
    CHECK(resident_bytes() >= before + (std::size_t{120} << 20));
    // Every other one first, so that the regions are full of holes.
    for (const std::size_t half : {0U, 1U}) {
      for (std::size_t i = half; i < buffers.size(); i += 2) {
        if (!intact(buffers[i])) FAIL("overwritten");
        PagePool::instance().release(buffers[i].at, buffers[i].bytes);
      }
      if (half == 0) CHECK(resident_bytes() <= before + (std::size_t{86} << 20) + kSlack);
    }
    CHECK(resident_bytes() <= before + kSlack);
  }
}

TEST_CASE("what is resident is used again before what would be faulted in") {
  // Released from the last one on: the first of them, which lie lowest, go back to the system.
  constexpr std::size_t kBytes = 3 * kPageBytes, kCount = 2000, kKept = 300;
  const auto buffers = [&](std::size_t count) {
    std::vector<Buffer> out(count, {nullptr, kBytes, 1});
    for (Buffer& buffer : out) {
      buffer.at = static_cast<std::uint64_t*>(PagePool::instance().allocate(kBytes));
      fill(buffer);
    }
    return out;
  };
  const auto release = [](std::vector<Buffer>& from, std::size_t left) {
    for (; from.size() > left; from.pop_back())
      PagePool::instance().release(from.back().at, from.back().bytes);
  };
  std::vector<Buffer> many = buffers(kCount);
  release(many, 1);  // so that its region stays
  const auto faults = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_minflt;
  };
  const auto before = faults();
  std::vector<Buffer> again = buffers(kKept);
  CHECK(faults() - before < 100);  // of 900 pages
  release(again, 0);
  release(many, 0);
}

TEST_CASE("huge pages go back whole while others have parts to spare") {
  constexpr std::size_t kBytes = 2 * kPageBytes, kHuge = std::size_t{2} << 20, kCount = 4096;
  const auto block_of = [](const Buffer& buffer) {
    return reinterpret_cast<std::uintptr_t>(buffer.at) / kHuge;
  };
  std::map<std::size_t, std::vector<Buffer>> blocks;
  // Until the last block is full, too: what is left of it would be idle.
  for (std::size_t i = 0, in_last = 0; i < kCount || in_last < kHuge / kBytes; ++i) {
    Buffer buffer{nullptr, kBytes, i};
    buffer.at = static_cast<std::uint64_t*>(PagePool::instance().allocate(kBytes));
    fill(buffer);
    blocks[block_of(buffer)].push_back(buffer);
    in_last = blocks[block_of(buffer)].size();
  }
  const std::size_t before = huge_bytes();
  const auto release = [](std::vector<Buffer>& from, std::size_t left) {
    for (; from.size() > left; from.pop_back())
      PagePool::instance().release(from.back().at, kBytes);
  };
  // Of every other block that is ours alone an eighth, of the ones between them all.
  std::vector<std::vector<Buffer>*> full;
  for (auto& [block, buffers] : blocks)
    if (buffers.size() == kHuge / kBytes) full.push_back(&buffers);
  for (std::size_t i = 0; i < full.size(); i += 2) release(*full[i], kHuge / kBytes * 7 / 8);
  for (std::size_t i = 1; i < full.size(); i += 2) release(*full[i], 0);
  if (before < 4 * kHuge) {
    std::puts("SKIPPED: huge pages (the system has none)");
  } else {
    CHECK(huge_bytes() < before);                             // some went back
    CHECK(huge_bytes() + full.size() / 2 * kHuge >= before);  // and none but the empty ones
  }
  for (auto& [block, buffers] : blocks) release(buffers, 0);
}

TEST_CASE("what is released together goes back when the last of those who release ends") {
  constexpr std::size_t kBytes = 4 * kPageBytes, kCount = 4000, kMiB = std::size_t{1} << 20;
  std::vector<Buffer> buffers;
  for (std::size_t i = 0; i < kCount; ++i) {
    buffers.push_back({nullptr, kBytes, i});
    buffers.back().at = static_cast<std::uint64_t*>(PagePool::instance().allocate(kBytes));
    fill(buffers.back());
  }
  const std::size_t before = resident_bytes();
  // Every other one, as those of two stores lie in between each other.
  const auto release = [&](std::size_t first) {
    for (std::size_t i = first; i < kCount; i += 2)
      PagePool::instance().release(buffers[i].at, buffers[i].bytes);
  };
  {
    const ReleaseTogether outer;
    {
      const ReleaseTogether inner;
      release(0);
    }
    CHECK(resident_bytes() + kMiB > before);
    // Meanwhile it can be used again.
    Buffer again{static_cast<std::uint64_t*>(PagePool::instance().allocate(kBytes)), kBytes, 7};
    fill(again);
    bool others_intact = true;
    for (std::size_t i = 1; i < kCount; i += 2) others_intact = others_intact && intact(buffers[i]);
    CHECK(others_intact);
    CHECK(intact(again));
    PagePool::instance().release(again.at, again.bytes);
  }
  // Half of 62 MiB, of which some 4 stay.
  CHECK(resident_bytes() < before - 24 * kMiB);
  release(1);
  CHECK(resident_bytes() < before - 50 * kMiB);
}

TEST_CASE("a page vector grows, shrinks and moves like any vector") {
  PageVector<int> numbers;
  for (int i = 0; i < 3000000; ++i) numbers.push_back(i);
  bool same = true;
  for (int i = 0; i < 3000000; ++i) same = same && numbers[static_cast<std::size_t>(i)] == i;
  CHECK(same);
  PageVector<int> moved = std::move(numbers);
  moved.resize(10);
  moved.shrink_to_fit();
  CHECK(moved == PageVector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9});
  CHECK(round_to_pages(0) == 0);
  CHECK(round_to_pages(1) == 4096);
  CHECK(round_to_pages(4097) == 8192);
}

TEST_CASE("columns of one size begin on lines of their own where there is room") {
  // 3,000 bytes leave 17 lines of a page.
  std::vector<PageVector<float>> columns;
  std::set<std::uintptr_t> lines;
  for (int i = 0; i < 17; ++i) {
    const auto at = reinterpret_cast<std::uintptr_t>(columns.emplace_back(750).data());
    CHECK(at % 64 == 0);
    CHECK(at % kPageBytes + 3000 <= kPageBytes);
    lines.insert(at % kPageBytes / 64);
  }
  CHECK(lines.size() == 17);
  const PageVector<float> full(kPageBytes / sizeof(float)), none;
  CHECK(reinterpret_cast<std::uintptr_t>(full.data()) % kPageBytes == 0);
}
