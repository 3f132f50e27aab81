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

namespace {

constexpr std::uint64_t kNearFront = 8;  // a list's first eighth

/// A bit per thing that was passed: 128 KiB. Where two share one, a little more is kept.
constexpr std::size_t kPassedBits = 1 << 20;

std::size_t passed_bit(std::size_t hash) {
  return static_cast<std::size_t>(std::uint64_t{hash} * 0x9E3779B97F4A7C15ULL >> 44);
}

}  // namespace

void MemoryBudget::drop_last(Recent& recent) {
  // A block that some piece of work reads right now lives on under that work's lease.
  const Kept& last = recent.back();
  cached_ -= last.bytes;
  if (last.reuse == Reuse::near) near_ -= last.bytes;
  kept_.erase(last.key);
  const auto own = items_.find(last.key.store);
  own->second.erase(last.key.item);
  if (own->second.empty()) items_.erase(own);
  recent.pop_back();
}

void MemoryBudget::make_room(std::uint64_t bytes) {
  Recent &near = recent(Reuse::near), &others = recent(Reuse::anywhere);
  while (leased_ + cached_ + bytes > limit_ && cached_ > 0) {
    const bool near_goes =
        others.empty() || (!near.empty() && near.back().used_at < others.back().used_at);
    drop_last(near_goes ? near : others);
  }
}

// What is made again although it had been kept once would have been worth its memory: from then on
// so much more is kept. Where there is room for it, a source that every page and target goes
// through is decoded twice at most.
void MemoryBudget::make_room_near(const CacheKey& key, std::uint64_t bytes) {
  if (!passed_.empty() && passed_[passed_bit(KeyHash{}(key))])
    near_most_ = std::min(near_most_ + bytes, limit_);
  Recent& near = recent(Reuse::near);
  while (near_ + bytes > near_most_ && !near.empty()) {
    passed_.resize(kPassedBits);
    passed_[passed_bit(KeyHash{}(near.back().key))] = true;
    drop_last(near);
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

std::uint64_t MemoryBudget::new_store() {
  const std::lock_guard lock(mutex_);
  return ++stores_;
}

std::shared_ptr<const void> MemoryBudget::find(const CacheKey& key) {
  const std::lock_guard lock(mutex_);
  const auto found = kept_.find(key);
  if (found == kept_.end()) return nullptr;
  Kept& kept = *found->second;
  Recent& list = recent(kept.reuse);
  // What is near the front stays where it is: threads that ask for the same few blocks do not take
  // the lines of the list from each other then.
  if (uses_ - kept.used_at > list.size() / kNearFront) {
    kept.used_at = ++uses_;
    list.splice(list.begin(), list, found->second);
  }
  return kept.thing;
}

void MemoryBudget::keep(const CacheKey& key, std::shared_ptr<const void> thing, std::uint64_t bytes,
                        Reuse reuse) {
  const std::lock_guard lock(mutex_);
  // Another thread may have decoded the same block meanwhile: the first one stays.
  if (bytes > limit_ || leased_ > limit_ - bytes || kept_.count(key) != 0) return;
  if (reuse == Reuse::near) {
    make_room_near(key, bytes);
    near_ += bytes;
  }
  make_room(bytes);
  Recent& list = recent(reuse);
  list.push_front({key, std::move(thing), bytes, reuse, ++uses_});
  kept_[key] = list.begin();
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
    const Kept& kept = *found->second;
    cached_ -= kept.bytes;
    if (kept.reuse == Reuse::near) near_ -= kept.bytes;
    recent(kept.reuse).erase(found->second);
    kept_.erase(found);
  }
  items_.erase(own);
}

void MemoryBudget::forget_all() {
  const std::lock_guard lock(mutex_);
  const ReleaseTogether together;
  cached_ = near_ = 0;
  items_.clear();
  kept_.clear();
  for (Recent& list : recent_) list.clear();
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
