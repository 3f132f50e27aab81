// SPDX-License-Identifier: Apache-2.0
//
// One number of bytes for everything large that a job holds. Work leases what it needs before it
// allocates; what no lease holds keeps decoded blocks, which may go at any moment. So a small
// budget costs reading a block again and never a failure, and no one has to decide how much is "for
// caching".
//
// try_lease() refuses instead of waiting: a thread that waited here would be one that cannot give
// its own lease back (there may be only one). Who waits, and for what, is the pump's affair.
#include "runtime/memory_budget.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/page_pool.h"

namespace pounce::runtime {

void MemoryBudget::make_room(std::uint64_t bytes) {
  // A block that some piece of work reads right now lives on under that work's lease.
  while (leased_ + cached_ + bytes > limit_ && !recent_.empty()) {
    const Kept& last = recent_.back();
    cached_ -= last.bytes;
    kept_.erase(last.key);
    const auto own = items_.find(last.key.store);
    own->second.erase(last.key.item);
    if (own->second.empty()) items_.erase(own);
    recent_.pop_back();
  }
}

bool MemoryBudget::try_lease(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  if (bytes > limit_ || leased_ > limit_ - bytes) return false;
  make_room(bytes);
  leased_ += bytes;
  peak_ = std::max(peak_, leased_ + cached_);
  return true;
}

void MemoryBudget::release(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  leased_ -= bytes;
}

std::shared_ptr<const void> MemoryBudget::find(const CacheKey& key) {
  const std::lock_guard lock(mutex_);
  const auto found = kept_.find(key);
  if (found == kept_.end()) return nullptr;
  recent_.splice(recent_.begin(), recent_, found->second);
  return found->second->thing;
}

void MemoryBudget::keep(const CacheKey& key, std::shared_ptr<const void> thing,
                        std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  // Another thread may have decoded the same block meanwhile: the first one stays.
  if (bytes > limit_ || leased_ > limit_ - bytes || kept_.count(key) != 0) return;
  make_room(bytes);
  recent_.push_front({key, std::move(thing), bytes});
  kept_[key] = recent_.begin();
  items_[key.store].insert(key.item);
  cached_ += bytes;
  peak_ = std::max(peak_, leased_ + cached_);
}

void MemoryBudget::forget(std::uint64_t store) {
  const std::lock_guard lock(mutex_);
  const auto own = items_.find(store);
  if (own == items_.end()) return;
  const ReleaseTogether together;
  for (const std::uint64_t item : own->second) {
    const auto found = kept_.find({store, item});
    cached_ -= found->second->bytes;
    recent_.erase(found->second);
    kept_.erase(found);
  }
  items_.erase(own);
}

void MemoryBudget::forget_all() {
  const std::lock_guard lock(mutex_);
  const ReleaseTogether together;
  cached_ = 0;
  items_.clear();
  kept_.clear();
  recent_.clear();
}

std::uint64_t MemoryBudget::leased() const {
  const std::lock_guard lock(mutex_);
  return leased_;
}

std::uint64_t MemoryBudget::leased_peak() const {
  const std::lock_guard lock(mutex_);
  return peak_;
}

Lease::Lease(MemoryBudget& budget, std::uint64_t bytes, const std::string& what)
    : budget_(&budget), bytes_(bytes) {
  if (!budget.try_lease(bytes)) {
    budget_ = nullptr;
    throw too_small(budget, bytes, what);
  }
}

Lease::Lease(Lease&& other) noexcept
    : budget_(std::exchange(other.budget_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}

Lease& Lease::operator=(Lease&& other) noexcept {
  // What this one held goes with the other.
  std::swap(budget_, other.budget_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

Lease::~Lease() {
  if (budget_ != nullptr) budget_->release(bytes_);
}

Error too_small(const MemoryBudget& budget, std::uint64_t bytes, const std::string& what) {
  const std::uint64_t leased = budget.leased();
  // In whole units, rounded up: what the message names is what is typed next.
  const std::uint64_t kib = (leased + bytes + 1023) / 1024, mib = (kib + 1023) / 1024;
  return {ErrorKind::budget,
          fmt::format("the memory budget of {} is too small: {} needs {} in addition to {} in use; "
                      "at least about {} is required (--memory)",
                      format_bytes(budget.limit()), what, format_bytes(bytes), format_bytes(leased),
                      mib < 4 ? fmt::format("{}KiB", kib) : fmt::format("{}MiB", mib))};
}

std::string format_bytes(std::uint64_t bytes) {
  const double b = static_cast<double>(bytes);
  if (bytes < 1024) return fmt::format("{} B", bytes);
  if (bytes < 1ULL << 20) return fmt::format("{:.1f} KiB", b / 1024);
  if (bytes < 1ULL << 30) return fmt::format("{:.1f} MiB", b / (1 << 20));
  return fmt::format("{:.2f} GiB", b / (1 << 30));
}

}  // namespace pounce::runtime
