// SPDX-License-Identifier: Apache-2.0
#include "flow/ordered_stream.h"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::flow;
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
  MemoryBudget budget(limit);
  Alive alive;
  std::vector<std::size_t> order;
  bool right = true;
  with_threads(threads, [&] {
    run_ordered<Result>(
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
  MemoryBudget budget(*std::max_element(costs.begin(), costs.end()));
  std::size_t taken = 0;
  with_threads(threads, [&] {
    run_ordered<int>(
        budget, costs, "count", [](std::size_t i) { return static_cast<int>(i); },
        [&](std::size_t i, int result) { taken += static_cast<std::size_t>(result) == i; });
  });
  CHECK(taken == 10000);
  CHECK(budget.leased() == 0);
  CHECK(budget.leased_peak() <= budget.limit());
}

TEST_CASE("a slow taker lets the budget fill up, but not over") {
  std::vector<std::uint64_t> costs(40, 10);
  MemoryBudget budget(30);
  Alive alive;
  with_threads(4, [&] {
    run_ordered<Result>(
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
  MemoryBudget budget(45);
  std::size_t taken = 0;
  const auto run = [&](const auto& failure) {
    with_threads(threads, [&] {
      run_ordered<int>(
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
  MemoryBudget budget(100);
  int made = 0;
  const auto run = [&] {
    run_ordered<int>(
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
  MemoryBudget budget(100);
  const Lease other(budget, 60, "something else");
  run_ordered<int>(
      budget, {}, "nothing", [](std::size_t) { return 0; }, [](std::size_t, int) {});
  std::size_t taken = 0;
  const std::vector<std::uint64_t> costs(50, 40);
  run_ordered<int>(
      budget, costs, "count", [](std::size_t) { return 0; }, [&](std::size_t, int) { ++taken; });
  CHECK(taken == 50);
  CHECK(budget.leased_peak() == 100);
  CHECK(budget.leased() == 60);
}

TEST_CASE("a pump admits in order and at most as many as asked for") {
  MemoryBudget budget(100);
  const std::vector<std::uint64_t> costs{60, 50, 10, 10, 10};
  std::vector<std::size_t> put;
  Pump pump(
      budget, costs, [&](std::size_t i) { put.push_back(i); }, 2);
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
