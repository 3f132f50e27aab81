// SPDX-License-Identifier: Apache-2.0
#include "runtime/waiting_thread.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <future>
#include <stdexcept>
#include <thread>
#include <vector>

namespace pounce::runtime {

TEST_CASE("a waiting thread works beside the caller, in order", "[flow]") {
  std::promise<void> gate;
  std::vector<int> done;
  std::vector<std::thread::id> threads;
  WaitingThread thread;
  const auto first = thread.begin([&, open = gate.get_future().share()] {
    open.wait();
    done.push_back(1);
    threads.push_back(std::this_thread::get_id());
  });
  const auto second = thread.begin([&] {
    done.push_back(2);
    threads.push_back(std::this_thread::get_id());
  });
  gate.set_value();  // would never come if begin() waited
  second->wait();
  CHECK(done == std::vector{1, 2});
  CHECK(threads[0] == threads[1]);
  CHECK(threads[0] != std::this_thread::get_id());
  first->wait();
}

TEST_CASE("an error of a waiting thread is its own work's", "[flow]") {
  WaitingThread thread;
  const auto wrong = thread.begin([] { throw std::runtime_error("no"); });
  const auto right = thread.begin([] {});
  CHECK_NOTHROW(right->wait());
  CHECK_THROWS_WITH(wrong->wait(), "no");
  (void)thread.begin([] { throw std::runtime_error("nobody asks"); });
}

TEST_CASE("who no longer wants it waits for a waiting thread", "[flow]") {
  bool done = false;
  {
    WaitingThread thread;
    (void)thread.begin([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      done = true;
    });
    CHECK(done);
  }
}

TEST_CASE("without a thread to be had the caller waits itself", "[flow]") {
  WaitingThread thread(false);
  std::thread::id worker;
  const auto work = thread.begin([&] { worker = std::this_thread::get_id(); });
  CHECK(worker == std::this_thread::get_id());
  const auto wrong = thread.begin([] { throw std::runtime_error("no"); });
  CHECK_NOTHROW(work->wait());
  CHECK_THROWS_WITH(wrong->wait(), "no");
}

}  // namespace pounce::runtime
