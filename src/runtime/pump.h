// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/task_arena.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "runtime/memory_budget.h"

namespace pounce::runtime {

/// Feeds work into a graph while its bytes fit the budget: in order, first come first served. Never
/// blocks a thread, so it works with one; counting messages instead of bytes would be no bound
/// (docs/decisions/002). `put` hands a work's index to the graph's first node and may run the node
/// here and now. Work that does not fit waits for what is under way; if nothing is, no release
/// would ever start it, and that is Error(budget), naming `what` it was for.
template <class Put>
class Pump {
 public:
  Pump(MemoryBudget& budget, std::span<const std::uint64_t> costs, std::string what, Put put,
       std::size_t most_at_once = few_per_thread())
      : budget_(budget),
        costs_(costs),
        what_(std::move(what)),
        put_(std::move(put)),
        most_at_once_(most_at_once) {}

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
        if (!budget_.try_lease(costs_[next_])) {
          if (at_once_ == 0) throw too_small(budget_, costs_[next_], what_);
          if (!stalled_since_) ++stalls_.count, stalled_since_ = Clock::now();
          return;
        }
        if (stalled_since_) {
          stalls_.seconds += std::chrono::duration<double>(Clock::now() - *stalled_since_).count();
          stalled_since_.reset();
        }
        held_ += costs_[next_];
        ++at_once_;
        work = next_++;
      }
      put_(work);  // outside the lock
    }
  }
  void release(std::size_t work) {
    {
      // Under the lock: who sees that nothing is under way sees its bytes free, too.
      const std::lock_guard lock(mutex_);
      --at_once_;
      held_ -= costs_[work];
      budget_.release(costs_[work]);
    }
    admit();
  }

  /// Works that had to wait for memory, and for how long.
  struct Stalls {
    std::uint64_t count = 0;
    double seconds = 0;
  };
  const Stalls& stalls() const { return stalls_; }  ///< once all is done

 private:
  using Clock = std::chrono::steady_clock;

  MemoryBudget& budget_;
  std::span<const std::uint64_t> costs_;
  const std::string what_;
  Put put_;
  const std::size_t most_at_once_;
  std::mutex mutex_;  ///< guards what follows
  std::size_t next_ = 0, at_once_ = 0;
  std::uint64_t held_ = 0;  ///< bytes of the leases of the works under way
  Stalls stalls_;
  std::optional<Clock::time_point> stalled_since_;  ///< the next work waits for memory
};

}  // namespace pounce::runtime
