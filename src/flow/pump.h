// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/task_arena.h>

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>

#include "flow/memory_budget.h"

namespace pounce::flow {

/// Feeds work into a graph while its bytes fit the budget: in order, first come first served. Never
/// blocks a thread, so it works with one; counting messages instead of bytes would be no bound
/// (docs/decisions/002). `put` hands a work's index to the graph's first node and may run the node
/// here and now.
template <class Put>
class Pump {
 public:
  Pump(MemoryBudget& budget, std::span<const std::uint64_t> costs, Put put,
       std::size_t most_at_once = few_per_thread())
      : budget_(budget), costs_(costs), put_(std::move(put)), most_at_once_(most_at_once) {}

  /// After an error, what was under way gives its leases back.
  ~Pump() { budget_.release(held_); }
  Pump(const Pump&) = delete;
  Pump& operator=(const Pump&) = delete;

  /// More works at once would not run any sooner, only push each other out of the processor's
  /// caches.
  static std::size_t few_per_thread() {
    return 3 * static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  }

  /// At the start, and after every release.
  void admit() {
    for (;;) {
      std::size_t work;
      {
        const std::lock_guard lock(mutex_);  // also the order of leases
        if (next_ == costs_.size() || at_once_ == most_at_once_) return;
        if (!budget_.try_lease(costs_[next_])) return;
        held_ += costs_[next_];
        ++at_once_;
        work = next_++;
      }
      put_(work);  // outside the lock
    }
  }
  void release(std::size_t work) {
    {
      const std::lock_guard lock(mutex_);
      --at_once_;
      held_ -= costs_[work];
    }
    budget_.release(costs_[work]);
    admit();
  }

 private:
  MemoryBudget& budget_;
  std::span<const std::uint64_t> costs_;
  Put put_;
  const std::size_t most_at_once_;
  std::mutex mutex_;  ///< guards what follows
  std::size_t next_ = 0, at_once_ = 0;
  std::uint64_t held_ = 0;  ///< bytes of the leases of the works under way
};

}  // namespace pounce::flow
