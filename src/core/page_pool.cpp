// SPDX-License-Identifier: Apache-2.0
//
// An allocator of pages inside 16 MiB regions, with bitmaps per region: the first run of resident
// pages that fits, else the start of a huge page, else the first run of any.
//
// Buffers are 1 page to a few hundred; larger ones get a mapping of their own. Regions keep the
// number of mappings small (the kernel allows 65,530). Freed pages stay resident for the next
// buffer. Where more than kMostIdlePages would, many are given back at once if there are many
// outside of huge pages, neighbours together: MADV_DONTNEED costs a call, and a page fault
// (0.1-0.3 us, under a hypervisor up to 8) when they are used again. They are taken from the
// highest regions, which empty first.
//
// Where the system has huge pages, the first touch of a block of 512 pages makes all of it
// resident: one fault for 512. What of it was not asked for counts as idle. Where that were more
// than is in use or expected to be (ExpectedUse), or more than may be idle, the block stays one of
// small pages. Of huge pages a part is given back only where nothing else is left: a hypervisor
// that keeps page tables of its own then maps all of the block anew, page by page, which costs as
// much as 512 faults.
//
// A buffer of 64 pages or more that is freed waits as it is for the next one of exactly its size:
// pieces of work ask for the same large buffers again and again, and would fault all their pages in
// each time (docs/decisions/003-page-pool.md).
//
// Who releases very much says so (ReleaseTogether): buffers are freed in another order than they
// lie in, so that what went back a few at a time would be a call for nearly each.
//
// Why not malloc: a general allocator keeps what was freed, in pieces that it cannot give back, so
// the process holds more than the budget leased. Here, what is idle is bounded by the constants
// below.
#include "core/page_pool.h"

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <bit>
#include <bitset>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <new>

#include "core/system_limits.h"

namespace pounce {
namespace {

constexpr std::size_t kRegionPages = 4096;       // 16 MiB of address space
constexpr std::size_t kBlockPages = 512;         // a huge page: 2 MiB
constexpr std::size_t kMostIdlePages = 1024;     // 4 MiB resident
constexpr std::size_t kGivenBackPages = 64;      // at once, if there are so many
constexpr std::size_t kLongRun = 64;             // pages from which a run waits for its like
constexpr std::size_t kMostWaitingPages = 2048;  // 8 MiB resident

/// A bit per page of a region.
using PageBits = std::array<std::uint64_t, kRegionPages / 64>;

/// The first page from `page` on whose bit is that; kRegionPages: none. Words at once.
std::size_t next(const PageBits& bits, bool is_set, std::size_t page) {
  while (page < kRegionPages) {
    const std::uint64_t word = (is_set ? bits[page / 64] : ~bits[page / 64]) >> (page % 64);
    if (word != 0) return page + static_cast<std::size_t>(std::countr_zero(word));
    page = (page / 64 + 1) * 64;
  }
  return kRegionPages;
}

/// The first run of `count` pages from `page` on whose bits are that, or kRegionPages.
std::size_t find_run(const PageBits& bits, bool is_set, std::size_t page, std::size_t count) {
  for (std::size_t first = next(bits, is_set, page); first < kRegionPages;) {
    const std::size_t end = next(bits, !is_set, first);
    if (end - first >= count) return first;
    first = next(bits, is_set, end);
  }
  return kRegionPages;
}

struct Region {
  std::byte* start = nullptr;
  std::size_t used_pages = 0, idle_pages = 0;
  std::size_t first_free = 0;  // no free page before this one
  PageBits used{};
  PageBits idle{};                                // free, but resident
  std::bitset<kRegionPages / kBlockPages> small;  // blocks without a huge page

  /// First run of `count` free pages, or kRegionPages.
  std::size_t find(std::size_t count) {
    if (kRegionPages - used_pages < count) return kRegionPages;
    first_free = next(used, false, first_free);
    return find_run(used, false, first_free, count);
  }
  /// The same of idle ones.
  std::size_t find_idle(std::size_t count) const {
    return idle_pages < count ? kRegionPages : find_run(idle, true, first_free, count);
  }
};

/// A long run that was freed and stays whole, resident, for the next buffer of its size.
struct WaitingRun {
  std::byte* at = nullptr;
  std::size_t pages = 0;
};

struct Pool {
  std::mutex mutex;                // guards everything below
  std::deque<WaitingRun> waiting;  // oldest first
  std::size_t waiting_pages = 0;
  std::map<std::byte*, std::unique_ptr<Region>> regions;
  std::size_t idle_pages = 0, used_pages = 0;
  std::size_t expected_pages = 0;  // to be in use, of all ExpectedUse that live
  const bool has_huge = huge_page_bytes() == kBlockPages * kPageBytes;
};

/// ReleaseTogether of this thread that live: the releases of others go back as ever.
thread_local std::size_t t_together = 0;

Pool& pool() {
  static auto* const the_pool =
      new Pool;  // never destroyed: buffers may outlive static destruction
  return *the_pool;
}

std::byte* map_pages(std::size_t bytes) {
  void* at = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (at == MAP_FAILED) throw std::bad_alloc();
  return static_cast<std::byte*>(at);
}

/// A region's pages, from where a huge page can begin.
std::byte* map_region(bool of_huge_pages) {
  constexpr std::size_t kBlockBytes = kBlockPages * kPageBytes;
  constexpr std::size_t kBytes = kRegionPages * kPageBytes;
  std::byte* const all = map_pages(kBytes + kBlockBytes);
  const std::size_t before =
      (kBlockBytes - reinterpret_cast<std::uintptr_t>(all) % kBlockBytes) % kBlockBytes;
  if (before > 0) munmap(all, before);
  if (before < kBlockBytes) munmap(all + before + kBytes, kBlockBytes - before);
  madvise(all + before, kBytes, of_huge_pages ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
  return all + before;
}

void keep_small(Region& region, std::size_t block) {
  if (region.small[block]) return;
  region.small[block] = true;
  // Nor may the system put one together later on, of pages that were given back.
  madvise(region.start + block * kBlockPages * kPageBytes, kBlockPages * kPageBytes,
          MADV_NOHUGEPAGE);
}

/// Whether no page of a block is resident, so that its first touch may be that of a huge page.
bool is_untouched(const Region& region, std::size_t block) {
  if (region.small[block]) return false;
  const std::size_t first = block * kBlockPages / 64;
  for (std::size_t word = first; word < first + kBlockPages / 64; ++word)
    if ((region.used[word] | region.idle[word]) != 0) return false;
  return true;
}

/// Whether a block may be a huge page although that many of its pages were not asked for.
bool may_be_huge(std::size_t beside, const Pool& p) {
  return beside == 0 || (beside <= std::max(p.used_pages, p.expected_pages) &&
                         p.idle_pages + beside <= kMostIdlePages);
}

/// The first page of an untouched block, or kRegionPages.
std::size_t find_untouched(const Region& region) {
  if (region.used_pages + region.idle_pages > kRegionPages - kBlockPages) return kRegionPages;
  for (std::size_t block = 0; block < kRegionPages / kBlockPages; ++block)
    if (is_untouched(region, block)) return block * kBlockPages;
  return kRegionPages;
}

/// Pages `first` to `end` of a block will be touched: the others will be resident, too, and idle.
void touch(Region& region, std::size_t block, std::size_t first, std::size_t end, Pool& p) {
  const std::size_t start = block * kBlockPages, beside = kBlockPages - (end - first);
  if (!is_untouched(region, block)) return;
  if (!may_be_huge(beside, p)) return keep_small(region, block);
  for (std::size_t page = start; page < start + kBlockPages; ++page)
    if (page < first || page >= end) region.idle[page / 64] |= 1ULL << (page % 64);
  region.idle_pages += beside;
  p.idle_pages += beside;
}

void mark_used(Region& region, std::size_t first, std::size_t count, Pool& p) {
  for (std::size_t block = first / kBlockPages; block * kBlockPages < first + count; ++block) {
    touch(region, block, std::max(first, block * kBlockPages),
          std::min(first + count, (block + 1) * kBlockPages), p);
  }
  for (std::size_t page = first; page < first + count; ++page) {
    const std::uint64_t bit = 1ULL << (page % 64);
    region.used[page / 64] |= bit;
    if ((region.idle[page / 64] & bit) != 0) {
      region.idle[page / 64] &= ~bit;
      --region.idle_pages;
      --p.idle_pages;
    }
  }
  region.used_pages += count;
  p.used_pages += count;
}

/// Of a run of pages the part that lies in small blocks alone, or in one huge block.
std::size_t end_of_kind(const Region& region, std::size_t first, std::size_t end) {
  std::size_t block = first / kBlockPages;
  const bool is_small = region.small[block];
  for (++block; block * kBlockPages < end; ++block)
    if (!is_small || !region.small[block]) return block * kBlockPages;
  return end;
}

/// Gives idle pages back to the system until that many are left: of small blocks, and huge ones as
/// a whole; or of all, where it `splits` huge ones. With p.mutex held.
void give_back(Pool& p, std::size_t most_idle, bool splits) {
  for (auto r = p.regions.rbegin(); r != p.regions.rend() && p.idle_pages > most_idle; ++r) {
    Region& region = *r->second;
    if (region.idle_pages == 0) continue;
    std::size_t end = 0;
    while (p.idle_pages > most_idle) {
      const std::size_t first = next(region.idle, true, end);
      if (first == kRegionPages) break;
      end = end_of_kind(region, first, next(region.idle, false, first));
      const std::size_t block = first / kBlockPages;
      if (!region.small[block] && end - first < kBlockPages) {
        if (!splits) continue;
        keep_small(region, block);
      }
      if (region.small[block]) end = std::min(end, first + (p.idle_pages - most_idle));
      madvise(region.start + first * kPageBytes, (end - first) * kPageBytes, MADV_DONTNEED);
      for (std::size_t page = first; page < end; ++page)
        region.idle[page / 64] &= ~(1ULL << (page % 64));
      region.idle_pages -= end - first;
      p.idle_pages -= end - first;
    }
  }
}

/// Gives back what is more than may be idle. With p.mutex held.
void give_back_surplus(Pool& p) {
  for (const bool splits : {false, true})
    if (t_together == 0 && p.idle_pages > kMostIdlePages)
      give_back(p, kMostIdlePages - kGivenBackPages, splits);
}

/// Gives pages back to their region, and an empty region to the system. With p.mutex held.
void free_run(Pool& p, std::byte* at, std::size_t pages) {
  const auto found = std::prev(p.regions.upper_bound(at));
  Region& region = *found->second;
  const auto first = static_cast<std::size_t>(at - region.start) / kPageBytes;
  for (std::size_t page = first; page < first + pages; ++page) {
    const std::uint64_t bit = 1ULL << (page % 64);
    region.used[page / 64] &= ~bit;
    region.idle[page / 64] |= bit;
  }
  p.idle_pages += pages;
  region.idle_pages += pages;
  if (first < region.first_free) region.first_free = first;
  region.used_pages -= pages;
  p.used_pages -= pages;
  if (region.used_pages == 0) {
    p.idle_pages -= region.idle_pages;
    munmap(region.start, kRegionPages * kPageBytes);
    p.regions.erase(found);
  }
  give_back_surplus(p);
}

}  // namespace

ReleaseTogether::ReleaseTogether() { ++t_together; }

ReleaseTogether::~ReleaseTogether() {
  --t_together;
  Pool& p = pool();
  const std::lock_guard lock(p.mutex);
  give_back_surplus(p);
}

ExpectedUse::ExpectedUse(std::uint64_t bytes) : pages_(bytes / kPageBytes) {
  Pool& p = pool();
  const std::lock_guard lock(p.mutex);
  p.expected_pages += pages_;
}

ExpectedUse::~ExpectedUse() {
  Pool& p = pool();
  const std::lock_guard lock(p.mutex);
  p.expected_pages -= pages_;
}

PagePool& PagePool::instance() {
  static PagePool the_instance;
  return the_instance;
}

void* PagePool::allocate(std::size_t bytes) {
  const std::size_t pages = (bytes + kPageBytes - 1) / kPageBytes;
  if (pages == 0) return nullptr;
  // A run must fit into a region beside others; a mapping of its own is also given back at once.
  // All of it is counted, so all of it may be huge pages.
  if (pages > kRegionPages / 2) {
    std::byte* const at = map_pages(pages * kPageBytes);
    madvise(at, pages * kPageBytes, MADV_HUGEPAGE);
    return at;
  }
  // One lock for all regions: buffers are large, and what is done in one takes far longer than
  // getting it.
  Pool& p = pool();
  const std::lock_guard lock(p.mutex);
  // The newest one first: its pages are most likely still in the processor's caches.
  for (auto run = p.waiting.rbegin(); pages >= kLongRun && run != p.waiting.rend(); ++run) {
    if (run->pages != pages) continue;
    std::byte* const at = run->at;
    p.waiting_pages -= pages;
    p.waiting.erase(std::next(run).base());
    return at;
  }
  // What is idle first: else idle pages would pile up behind others that have to be faulted in.
  for (auto& [start, region] : p.regions) {
    if (p.idle_pages < pages) break;
    const std::size_t first = region->find_idle(pages);
    if (first == kRegionPages) continue;
    mark_used(*region, first, pages, p);
    return start + first * kPageBytes;
  }
  // Then a huge page, which costs one fault, before pages of small blocks, which cost one each.
  if (pages <= kBlockPages && may_be_huge(kBlockPages - pages, p)) {
    for (auto& [start, region] : p.regions) {
      const std::size_t first = find_untouched(*region);
      if (first == kRegionPages) continue;
      mark_used(*region, first, pages, p);
      return start + first * kPageBytes;
    }
  }
  // In order of address: low regions fill up, high ones empty and go back to the system.
  for (auto& [start, region] : p.regions) {
    const std::size_t first = region->find(pages);
    if (first == kRegionPages) continue;
    mark_used(*region, first, pages, p);
    return start + first * kPageBytes;
  }
  auto region = std::make_unique<Region>();
  region->start = map_region(p.has_huge);
  if (!p.has_huge) region->small.set();
  std::byte* const start = region->start;
  Region& first = *p.regions.emplace(start, std::move(region)).first->second;
  mark_used(first, 0, pages, p);
  return start;
}

void PagePool::release(void* at, std::size_t bytes) noexcept {
  const std::size_t pages = (bytes + kPageBytes - 1) / kPageBytes;
  if (pages == 0) return;
  if (pages > kRegionPages / 2) {
    munmap(at, pages * kPageBytes);
    return;
  }
  Pool& p = pool();
  const std::lock_guard lock(p.mutex);
  if (pages < kLongRun) return free_run(p, static_cast<std::byte*>(at), pages);
  try {
    p.waiting.push_back({static_cast<std::byte*>(at), pages});
  } catch (const std::bad_alloc&) {
    // It need not wait; but what is released must be, here of all places.
    return free_run(p, static_cast<std::byte*>(at), pages);
  }
  p.waiting_pages += pages;
  while (p.waiting_pages > kMostWaitingPages) {
    const WaitingRun oldest = p.waiting.front();
    p.waiting.pop_front();
    p.waiting_pages -= oldest.pages;
    free_run(p, oldest.at, oldest.pages);
  }
}

}  // namespace pounce
