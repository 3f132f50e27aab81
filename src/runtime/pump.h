// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/flow_graph.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "pounce/error.h"
#include "runtime/memory_budget.h"

namespace pounce::runtime {

/// So many for each thread of the arena. More would not run any sooner, only push each other out of
/// the processor's caches.
inline std::size_t works_at_once(std::size_t per_thread = 3) {
  return per_thread * static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
}

/// Feeds work into a graph while its bytes fit the budget: in order, first come first served. Never
/// blocks a thread, so it works with one; counting messages instead of bytes would be no bound
/// (docs/decisions/002). `put` hands a work's index to the graph's first node and may run the node
/// here and now. Work that does not fit waits for what is under way; if nothing is, no release
/// would ever start it, and that is Error(budget), naming `what` it was for.
template <class Put>
class Pump {
 public:
  Pump(MemoryBudget& budget, std::span<const std::uint64_t> costs, std::string what, Put put,
       std::size_t most_at_once = works_at_once())
      : budget_(budget),
        costs_(costs),
        what_(std::move(what)),
        put_(std::move(put)),
        most_at_once_(most_at_once) {}

  /// After an error, what was under way gives its leases back.
  ~Pump() {
    for (const auto& [work, bytes] : leases_) budget_.release(bytes);
  }
  Pump(const Pump&) = delete;
  Pump& operator=(const Pump&) = delete;

  /// At the start, and after every release.
  void admit() {
    for (;;) {
      std::size_t work;
      {
        const std::lock_guard lock(mutex_);  // also the order of leases
        if (next_ == costs_.size() || leases_.size() == most_at_once_) return;
        if (!budget_.try_lease(costs_[next_])) {
          if (leases_.empty()) throw too_small(budget_, costs_[next_], what_);
          if (!stalled_since_) ++stalls_.count, stalled_since_ = Clock::now();
          return;
        }
        if (stalled_since_) {
          stalls_.seconds += std::chrono::duration<double>(Clock::now() - *stalled_since_).count();
          stalled_since_.reset();
        }
        leases_[next_] = costs_[next_];
        work = next_++;
      }
      put_(work);  // outside the lock
    }
  }
  void release(std::size_t work) {
    {
      // Under the lock: who sees that nothing is under way sees its bytes free, too.
      const std::lock_guard lock(mutex_);
      const auto lease = leases_.find(work);
      budget_.release(lease->second);
      leases_.erase(lease);
    }
    admit();
  }
  /// A work that is under way knows what it needs, itself and no more: less than it cost, or more
  /// if that can be had. Returns what it has from now on.
  std::uint64_t resize(std::size_t work, std::uint64_t bytes) {
    {
      const std::lock_guard lock(mutex_);
      std::uint64_t& lease = leases_.at(work);
      if (bytes >= lease) {
        if (budget_.try_lease(bytes - lease)) lease = bytes;
        return lease;
      }
      budget_.release(lease - bytes);
      lease = bytes;
    }
    admit();
    return bytes;
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
  std::size_t next_ = 0;
  std::map<std::size_t, std::uint64_t> leases_;  ///< bytes of each work under way
  Stalls stalls_;
  std::optional<Clock::time_point> stalled_since_;  ///< the next work waits for memory
};

// --- ordered streams -----------------------------------------------------------------------------

/// Runs make(i) for every i in parallel and take(i, result) one at a time in order of i, with as
/// many results alive as the budget holds, at most `most_at_once`. costs[i] is the lease of work i
/// from before make until after take. Throws Error(budget), naming `what` it is for, if one work
/// alone does not fit (before anything is made, if that is known then), and whatever make or take
/// throw.
template <class Result, class Make, class Take>
void run_ordered(MemoryBudget& budget, std::span<const std::uint64_t> costs,
                 const std::string& what, Make make, Take take,
                 std::size_t most_at_once = works_at_once()) {
  namespace tf = tbb::flow;
  if (costs.empty()) return;
  { const Lease fits(budget, *std::max_element(costs.begin(), costs.end()), what); }

  struct Item {
    std::size_t index;
    std::optional<Result> result;
  };
  using ItemPtr = std::shared_ptr<Item>;
  std::size_t taken = 0;
  tf::graph graph;
  tf::function_node<std::size_t, ItemPtr> maker(graph, tf::unlimited, [&](std::size_t i) {
    return std::make_shared<Item>(Item{i, make(i)});
  });
  auto pump = Pump(
      budget, costs, what, [&](std::size_t i) { maker.try_put(i); }, most_at_once);
  tf::sequencer_node<ItemPtr> in_order(graph, [](const ItemPtr& item) { return item->index; });
  tf::function_node<ItemPtr> taker(graph, tf::serial, [&](const ItemPtr& item) {
    take(item->index, *item->result);
    // Its memory goes before its lease does; the graph still holds the item itself.
    item->result.reset();
    ++taken;
    pump.release(item->index);
  });
  tf::make_edge(maker, in_order);
  tf::make_edge(in_order, taker);
  pump.admit();
  graph.wait_for_all();  // rethrows
  if (taken != costs.size())
    throw Error(ErrorKind::internal, "a flow graph ended early while it was to " + what);
}

}  // namespace pounce::runtime
