// SPDX-License-Identifier: Apache-2.0
#pragma once

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
  Pump(MemoryBudget& budget, std::span<const std::uint64_t> costs, Put put)
      : budget_(budget), costs_(costs), put_(std::move(put)) {}

  /// At the start, and after every release.
  void admit() {
    for (;;) {
      std::size_t work;
      {
        const std::lock_guard lock(mutex_);  // guards next_ and the order of leases
        if (next_ == costs_.size() || !budget_.try_lease(costs_[next_])) return;
        work = next_++;
      }
      put_(work);  // outside the lock
    }
  }
  void release(std::size_t work) {
    budget_.release(costs_[work]);
    admit();
  }

 private:
  MemoryBudget& budget_;
  std::span<const std::uint64_t> costs_;
  Put put_;
  std::mutex mutex_;
  std::size_t next_ = 0;
};

}  // namespace pounce::flow
