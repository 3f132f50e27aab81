// SPDX-License-Identifier: Apache-2.0
#include "job/run_job.h"

#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <functional>
#include <mutex>
#include <new>
#include <set>
#include <stdexcept>
#include <thread>

#include "pounce/transfer.h"

namespace pounce::job {
namespace {

using Clock = std::chrono::steady_clock;

/// Do two tasks of one loop run at the same time? Each waits for the other, for some seconds.
bool two_meet() {
  std::atomic<int> arrived{0};
  std::atomic<bool> met{true};
  const auto late = Clock::now() + std::chrono::seconds(20);
  tbb::parallel_for(
      0, 2,
      [&](int) {
        ++arrived;
        while (arrived < 2 && Clock::now() < late) std::this_thread::yield();
        if (arrived < 2) met = false;
      },
      tbb::simple_partitioner());
  return met;
}

/// Threads that take part in a loop of many tasks.
std::size_t threads_of_a_loop() {
  std::mutex mutex;
  std::set<std::thread::id> threads;
  tbb::parallel_for(
      0, 64,
      [&](int) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        const std::lock_guard lock(mutex);
        threads.insert(std::this_thread::get_id());
      },
      tbb::simple_partitioner());
  return threads.size();
}

Resources with_threads(unsigned threads) {
  Resources resources;
  resources.threads = threads;
  return resources;
}

}  // namespace

TEST_CASE("a job that any exception ends hands over its report", "[job]") {
  const auto ended_by = [](const std::function<void()>& end) {
    Report so_far;
    CHECK_THROWS_AS(run_job(with_threads(1), nullptr, &so_far,
                            [&](JobRun& run, bool) {
                              run.report.command = "transfer";
                              end();
                            }),
                    Error);
    CHECK(so_far.command == "transfer");
    REQUIRE(so_far.failure);
    return so_far.failure->kind + ": " + so_far.failure->message;
  };
  CHECK(ended_by([] { throw Error(ErrorKind::input, "no mesh"); }) == "input: no mesh");
  CHECK(ended_by([] { throw std::out_of_range("map::at"); }) ==
        "internal: an error inside pounce: map::at; please report it");
  CHECK(ended_by([] { throw std::bad_alloc(); }).starts_with("budget: out of memory"));
  CHECK(ended_by([] { throw 1; }).starts_with("internal: "));
}

TEST_CASE("what a listener throws stops the job as an Error", "[job]") {
  const auto ended_by = [](const std::function<void()>& end) -> std::string {
    Progress progress;
    progress.on_event = [&](const ProgressEvent&) { end(); };
    Report so_far;
    try {
      run_job(with_threads(2), &progress, &so_far, [&](JobRun& run, bool) {
        tbb::parallel_for(0, 4, [&](int) { run.meter.begin("work", 1, "steps", 1); });
      });
    } catch (const Error& error) {
      REQUIRE(so_far.failure);
      CHECK(so_far.failure->kind == error_kind_name(error.kind()));
      std::string text = error_kind_name(error.kind()) + std::string(": ") + error.what();
      try {
        std::rethrow_if_nested(error);
      } catch (const std::domain_error&) {
        text += " (nested)";
      } catch (int) {
        text += " (nested int)";
      }
      return text;
    } catch (...) {
      return "left the library as it was";
    }
    return "nothing";
  };
  CHECK(ended_by([] { throw std::domain_error("window closed"); }) ==
        "cancelled: stopped: Progress::on_event threw: window closed (nested)");
  CHECK(ended_by([] { throw 1; }) ==
        "cancelled: stopped: Progress::on_event threw an unknown exception (nested int)");
  CHECK(ended_by([] { throw Error(ErrorKind::usage, "mine"); }) == "usage: mine");
}

TEST_CASE("a job leaves what runs beside it its threads", "[job]") {
  if (tbb::info::default_concurrency() < 2) return;
  run_job(with_threads(1), nullptr, nullptr, [](JobRun&, bool) {
    bool met = false;
    std::thread host([&] { met = two_meet(); });
    host.join();
    CHECK(met);
  });
}

TEST_CASE("two jobs in one process keep their own numbers of threads", "[job]") {
  if (tbb::info::default_concurrency() < 2) return;
  run_job(with_threads(1), nullptr, nullptr, [](JobRun&, bool) {
    bool met = false;
    std::size_t inner = 0;
    std::thread host([&] {
      run_job(with_threads(2), nullptr, nullptr, [&](JobRun&, bool) {
        met = two_meet();
        inner = threads_of_a_loop();
      });
    });
    const std::size_t outer = threads_of_a_loop();
    host.join();
    CHECK(met);
    CHECK(outer == 1);
    CHECK(inner <= 2);
  });
}

TEST_CASE("the report of a failed job says what happened and what was done", "[job]") {
  Report so_far;
  CHECK_THROWS_AS(run_job(with_threads(1), nullptr, &so_far,
                          [](JobRun& run, bool) {
                            run.report.outputs = {"first.png"};
                            throw Error(ErrorKind::storage, "second.png: the disk is full");
                          }),
                  Error);
  REQUIRE(so_far.failure);
  CHECK(so_far.failure->kind == "storage");
  CHECK(so_far.failure->exit_status == 5);
  CHECK(so_far.failure->message == "second.png: the disk is full");
  CHECK(so_far.outputs == std::vector<std::string>{"first.png"});
}

TEST_CASE("what no transfer can do is refused before any file is looked at", "[job]") {
  TransferOptions options;
  options.source = "absent.glb";
  options.targets = {"absent.glb"};
  options.output = "o.png";
  const auto kind = [&options] {
    Report report;
    CHECK_THROWS_AS(transfer(options, nullptr, &report), Error);
    return report.failure ? report.failure->kind : std::string();
  };
  CHECK(kind() != "usage");
  options.image.padding_px = 4096;
  CHECK(kind() != "usage");
  options.image.padding_px = 4097;  // beyond the option table's range
  CHECK(kind() == "usage");
  options.image.padding_px.reset();
  options.min_coverage_percent = 101;
  CHECK(kind() == "usage");
}

}  // namespace pounce::job
