// SPDX-License-Identifier: Apache-2.0
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <functional>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

#include "runtime/pump.h"
#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::runtime;
using pounce::test::Random;

namespace {

/// Bytes that are alive, and the most that ever were.
struct Alive {
  std::atomic<std::uint64_t> bytes = 0, most = 0;
  void add(std::uint64_t more) {
    const std::uint64_t now = bytes += more;
    std::uint64_t seen = most;
    while (seen < now && !most.compare_exchange_weak(seen, now)) {
    }
  }
};

/// A result that counts its bytes for as long as it lives.
struct Result {
  Alive* alive = nullptr;
  std::uint64_t bytes = 0;
  std::size_t index = 0;
  Result() = default;
  Result(Alive& a, std::uint64_t b, std::size_t i) : alive(&a), bytes(b), index(i) { a.add(bytes); }
  Result(Result&& other) noexcept
      : alive(std::exchange(other.alive, nullptr)), bytes(other.bytes), index(other.index) {}
  Result& operator=(Result&&) = delete;
  ~Result() {
    if (alive != nullptr) alive->bytes -= bytes;
  }
};

void work_a_little(std::uint64_t steps) {
  volatile std::uint64_t sink = 0;
  for (std::uint64_t i = 0; i < steps; ++i) sink = sink + i;
}

/// Runs in an arena of its own with so many threads, whatever the machine has.
template <class Body>
void with_threads(int threads, const Body& body) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  tbb::task_arena arena(threads);
  arena.execute(body);
}

}  // namespace

TEST_CASE("results are taken in order and never exceed the budget, at any number of threads") {
  const int threads = GENERATE(1, 2, 8);
  const std::uint64_t limit = GENERATE(100U, 350U, 100000U);
  CAPTURE(threads, limit);
  Random random(101);
  std::vector<std::uint64_t> costs(500);
  for (std::uint64_t& cost : costs) cost = 1 + random.below(100);
  costs[250] = 100;
  runtime::MemoryBudget budget(limit);
  Alive alive;
  std::vector<std::size_t> order;
  bool right = true;
  with_threads(threads, [&] {
    runtime::run_ordered<Result>(
        budget, costs, "count",
        [&](std::size_t i) {
          Result result(alive, costs[i], i);
          work_a_little(i * 7919 % 5000);
          return result;
        },
        [&](std::size_t i, Result& result) {
          right = right && result.index == i;
          order.push_back(i);
        });
  });
  std::vector<std::size_t> expected(costs.size());
  std::iota(expected.begin(), expected.end(), std::size_t{0});
  CHECK(order == expected);
  CHECK(right);
  CHECK(alive.most <= limit);
  CHECK(alive.bytes == 0);
  CHECK(budget.leased() == 0);
  CHECK(budget.leased_peak() <= limit);
}

TEST_CASE("ten thousand tiny works of a budget that holds just the largest all end") {
  const int threads = GENERATE(1, 2, 3, 4, 8, 16);
  CAPTURE(threads);
  Random random(102 + static_cast<std::uint64_t>(threads));
  std::vector<std::uint64_t> costs(10000);
  for (std::uint64_t& cost : costs) cost = random.below(1000);
  runtime::MemoryBudget budget(*std::max_element(costs.begin(), costs.end()));
  std::size_t taken = 0;
  with_threads(threads, [&] {
    runtime::run_ordered<int>(
        budget, costs, "count", [](std::size_t i) { return static_cast<int>(i); },
        [&](std::size_t i, int result) { taken += static_cast<std::size_t>(result) == i; });
  });
  CHECK(taken == 10000);
  CHECK(budget.leased() == 0);
  CHECK(budget.leased_peak() <= budget.limit());
}

TEST_CASE("a slow taker lets the budget fill up, but not over") {
  std::vector<std::uint64_t> costs(40, 10);
  runtime::MemoryBudget budget(30);
  Alive alive;
  with_threads(4, [&] {
    runtime::run_ordered<Result>(
        budget, costs, "count", [&](std::size_t i) { return Result(alive, 10, i); },
        [&](std::size_t, Result&) { std::this_thread::sleep_for(std::chrono::milliseconds(2)); });
  });
  CHECK(alive.most <= 30);
  CHECK(alive.most >= 20);
}

TEST_CASE("an error of either side comes out with its type, wherever it happens") {
  const int threads = GENERATE(1, 2, 8);
  const std::size_t where = GENERATE(0U, 57U, 99U);
  const bool in_make = GENERATE(true, false);
  CAPTURE(threads, where, in_make);
  const std::vector<std::uint64_t> costs(100, 10);
  runtime::MemoryBudget budget(45);
  std::size_t taken = 0;
  const auto run = [&](const auto& failure) {
    with_threads(threads, [&] {
      runtime::run_ordered<int>(
          budget, costs, "count",
          [&](std::size_t i) {
            if (in_make && i == where) failure();
            return 0;
          },
          [&](std::size_t i, int) {
            if (!in_make && i == where) failure();
            ++taken;
          });
    });
  };
  CHECK(test::error_kind([&] { run([] { throw Error(ErrorKind::damaged_store, "broken"); }); }) ==
        test::kDamaged);
  CHECK(taken <= where);
  CHECK(budget.leased() == 0);  // what was under way gave its leases back
  CHECK_THROWS_AS(run([] { throw std::length_error("long"); }), std::length_error);
}

TEST_CASE("a work that does not fit alone is refused before anything is made") {
  const std::vector<std::uint64_t> costs{10, 10, 101, 10};
  runtime::MemoryBudget budget(100);
  int made = 0;
  const auto run = [&] {
    runtime::run_ordered<int>(
        budget, costs, "vectorizing the target", [&](std::size_t) { return ++made; },
        [](std::size_t, int) {});
  };
  std::string message;
  CHECK(test::error_kind(run, &message) == static_cast<int>(ErrorKind::budget));
  CHECK(message.find("vectorizing the target") != std::string::npos);
  CHECK(made == 0);
  CHECK(budget.leased() == 0);
}

TEST_CASE("no work is no error, and work beside other leases takes what they leave") {
  runtime::MemoryBudget budget(100);
  const runtime::Lease other(budget, 60, "something else");
  runtime::run_ordered<int>(
      budget, {}, "nothing", [](std::size_t) { return 0; }, [](std::size_t, int) {});
  std::size_t taken = 0;
  const std::vector<std::uint64_t> costs(50, 40);
  runtime::run_ordered<int>(
      budget, costs, "count", [](std::size_t) { return 0; }, [&](std::size_t, int) { ++taken; });
  CHECK(taken == 50);
  CHECK(budget.leased_peak() == 100);
  CHECK(budget.leased() == 60);
}

TEST_CASE("a pump admits in order and at most as many as asked for") {
  runtime::MemoryBudget budget(100);
  const std::vector<std::uint64_t> costs{60, 50, 10, 10, 10};
  std::vector<std::size_t> put;
  runtime::Pump pump(
      budget, costs, "count", [&](std::size_t i) { put.push_back(i); }, 2);
  pump.admit();
  CHECK(put == std::vector<std::size_t>{0});  // 1 does not fit, and 2 does not overtake it
  pump.admit();
  CHECK(put.size() == 1);
  pump.release(0);
  CHECK(put == std::vector<std::size_t>{0, 1, 2});  // 3 would fit, but two are enough
  CHECK(budget.leased() == 60);
  pump.release(2);
  pump.release(1);
  pump.release(4);
  pump.release(3);
  CHECK(put == std::vector<std::size_t>{0, 1, 2, 3, 4});
  CHECK(budget.leased() == 0);
}

TEST_CASE("a pump that can start nothing says what needs how much") {
  runtime::MemoryBudget budget(100);
  std::vector<std::size_t> put;
  const auto put_it = [&](std::size_t i) { put.push_back(i); };
  std::string message;
  SECTION("at the start, where something else holds the bytes") {
    const runtime::Lease other(budget, 41, "something else");
    const std::vector<std::uint64_t> costs{60};
    runtime::Pump pump(budget, costs, "projecting", put_it);
    CHECK(test::error_kind([&] { pump.admit(); }, &message) == static_cast<int>(ErrorKind::budget));
    CHECK(message.find("projecting needs 60 B in addition to 41 B in use") != std::string::npos);
    CHECK(put.empty());
  }
  SECTION("after the last release, where the next is larger than all") {
    const std::vector<std::uint64_t> costs{60, 30, 101};
    runtime::Pump pump(budget, costs, "projecting", put_it);
    pump.admit();
    CHECK(put.size() == 2);
    pump.release(1);  // 0 is under way: its release will try again
    CHECK(test::error_kind([&] { pump.release(0); }, &message) ==
          static_cast<int>(ErrorKind::budget));
    CHECK(message.find("projecting needs 101 B in addition to 0 B in use") != std::string::npos);
  }
  CHECK(put.size() <= 2);
}

TEST_CASE("a stream whose bytes were taken away ends with what its next work needs") {
  const int threads = GENERATE(1, 2, 8);
  CAPTURE(threads);
  const std::vector<std::uint64_t> costs{50, 60};
  runtime::MemoryBudget budget(100);
  runtime::Lease other;
  std::string message;
  const auto run = [&] {
    with_threads(threads, [&] {
      runtime::run_ordered<int>(
          budget, costs, "sorting", [](std::size_t) { return 0; },
          [&](std::size_t, int) { other = runtime::Lease(budget, 41, "something else"); });
    });
  };
  CHECK(test::error_kind(run, &message) == static_cast<int>(ErrorKind::budget));
  CHECK(message.find("sorting needs 60 B in addition to 41 B in use") != std::string::npos);
  CHECK(budget.leased() == 41);
}

TEST_CASE("no work is refused for bytes that another one is just giving back") {
  const int threads = GENERATE(2, 8);
  CAPTURE(threads);
  const std::vector<std::uint64_t> costs(20000, 50);
  runtime::MemoryBudget budget(100);
  std::atomic<std::size_t> done = 0;
  with_threads(threads, [&] {
    tbb::flow::graph graph;
    runtime::Pump<std::function<void(std::size_t)>>* pump_at = nullptr;
    tbb::flow::function_node<std::size_t> work(graph, tbb::flow::unlimited, [&](std::size_t i) {
      ++done;
      pump_at->release(i);  // by several threads at once
    });
    runtime::Pump<std::function<void(std::size_t)>> pump(budget, costs, "count",
                                                         [&](std::size_t i) { work.try_put(i); });
    pump_at = &pump;
    pump.admit();
    graph.wait_for_all();
  });
  CHECK(done == costs.size());
  CHECK(budget.leased() == 0);
}

TEST_CASE("work under way gives back what it does not need, and never waits for more") {
  runtime::MemoryBudget budget(100);
  const std::vector<std::uint64_t> costs{60, 50, 10};
  std::vector<std::size_t> put;
  {
    runtime::Pump pump(
        budget, costs, "count", [&](std::size_t i) { put.push_back(i); }, 2);
    pump.admit();
    CHECK(pump.resize(0, 80) == 80);
    CHECK(pump.resize(0, 101) == 80);
    CHECK(budget.leased() == 80);
    CHECK(pump.resize(0, 45) == 45);  // and the next one fits
    CHECK(put == std::vector<std::size_t>{0, 1});
    CHECK(budget.leased() == 95);
    pump.release(0);
    CHECK(put.size() == 3);
    CHECK(budget.leased() == 60);
  }
  CHECK(budget.leased() == 0);
}
