// SPDX-License-Identifier: Apache-2.0
//
// Bounds here are on sums and on CPU time that the test has read itself, around and within what a
// timer measures: never on how fast a machine is, nor on a loop ending when it should. A virtual
// machine's clock of CPU time goes in steps of milliseconds where its host runs something else.
#include "core/timer.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <map>
#include <thread>
#include <vector>

namespace pounce {
namespace {

/// Works until this thread has used that much CPU time. Returns what it has used: at least that.
double burn(double seconds) {
  const double start = thread_cpu_seconds();
  double used = 0;
  while (used < seconds) used = thread_cpu_seconds() - start;
  return used;
}

void sleep_s(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

std::map<std::string, StageTime> by_name(const StageClock& clock) {
  std::map<std::string, StageTime> times;
  for (const StageTime& time : clock.times()) times[time.name] = time;
  return times;
}

TEST_CASE("sleeping costs wall time and no CPU time", "[core]") {
  StageClock clock;
  const double before = process_cpu_seconds();
  {
    const StageTimer timer(clock, "sleep");
    sleep_s(0.05);
  }
  const double used = process_cpu_seconds() - before;
  const StageTime time = clock.times().at(0);
  CHECK(time.wall_s >= 0.05);
  CHECK(time.cpu_s <= used);
}

TEST_CASE("a stage counts the CPU time of all threads", "[core]") {
  StageClock clock;
  {
    const StageTimer timer(clock, "work");
    std::thread other([] { burn(0.04); });
    burn(0.04);
    other.join();
  }
  CHECK(clock.times().at(0).cpu_s >= 0.079);
}

TEST_CASE("CPU time is attributed once, to the innermost stage", "[core]") {
  StageClock clock;
  const double before = process_cpu_seconds();
  double within = 0;  // CPU seconds of the process while "whole" runs
  double of_thread = 0, burnt_as_project = 0, burnt_as_decode = 0;
  {
    const StageTimer whole(clock, "whole");
    const double start = process_cpu_seconds();
    burn(0.02);
    std::thread other([&] {
      const double thread_start = thread_cpu_seconds();
      {
        const WorkTimer project(clock, "project");
        burnt_as_project = burn(0.02);
        const WorkTimer decode(clock, "decode");
        burnt_as_decode = burn(0.03);
      }
      of_thread = thread_cpu_seconds() - thread_start;
    });
    {
      const StageTimer part(clock, "part");
      burn(0.02);
      other.join();
    }
    clock.add_cpu("told", 0);
    within = process_cpu_seconds() - start;
  }
  const double used = process_cpu_seconds() - before;
  const auto times = by_name(clock);
  CHECK(times.at("project").cpu_s >= burnt_as_project);
  CHECK(times.at("project").cpu_s <= of_thread - burnt_as_decode);
  CHECK(times.at("decode").cpu_s >= burnt_as_decode);
  double sum = 0;
  for (const auto& [name, time] : times) sum += time.cpu_s;
  // Clocks of threads and of the process are read at different moments.
  CHECK(sum <= used + 1e-3);
  CHECK(sum >= within - 1e-3);
}

TEST_CASE("wall time is counted while at least one timer of a stage runs", "[core]") {
  StageClock clock;
  const double before = wall_seconds();
  const auto work = [&] {
    const WorkTimer timer(clock, "node");
    sleep_s(0.03);
  };
  std::thread first(work), second(work), third(work);
  first.join();
  second.join();
  third.join();
  work();
  const double passed = wall_seconds() - before;
  CHECK(clock.times().at(0).wall_s >= 0.06);
  CHECK(clock.times().at(0).wall_s <= passed);
}

TEST_CASE("many threads add to one stage without losing any", "[core]") {
  StageClock clock;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&clock] {
      for (int i = 0; i < 1000; ++i) {
        const WorkTimer timer(clock, "tick");
        clock.add_cpu("counted", 0.5);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(by_name(clock).at("counted").cpu_s == 2000);
}

TEST_CASE("stages keep the order of their first mention and say what was cached", "[core]") {
  StageClock clock;
  clock.set_cached("vectorize");
  { const StageTimer timer(clock, "assemble"); }
  { const StageTimer timer(clock, "vectorize"); }
  const auto times = clock.times();
  REQUIRE(times.size() == 2);
  CHECK(times[0].name == "vectorize");
  CHECK(times[0].cached);
  CHECK(times[1].name == "assemble");
  CHECK_FALSE(times[1].cached);
}

TEST_CASE("the peak of resident memory grows with what is touched", "[core]") {
  const std::uint64_t before = peak_rss_bytes();
  CHECK(before > 1u << 20);
  std::vector<char> touched(std::size_t{before} + (64u << 20), 1);
  CHECK(touched.back() == 1);
  CHECK(peak_rss_bytes() >= before + (60u << 20));
}

}  // namespace
}  // namespace pounce
