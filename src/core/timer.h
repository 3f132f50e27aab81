// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "pounce/report.h"

namespace pounce {

/// Where the time of a job goes, by stage. CPU seconds are attributed once: those of a stage do not
/// contain what a timer of another stage inside it counted, so that all stages together are the
/// process's CPU time. A stage's wall time is the time during which at least one of its timers ran.
/// Thread-safe.
class StageClock {
 public:
  /// Adds CPU seconds that were measured elsewhere.
  void add_cpu(const std::string& stage, double seconds);
  /// Notes that the stage's result came from the cache; the stage is listed even if it took no
  /// time.
  void set_cached(const std::string& stage);
  /// In the order in which the stages were first mentioned. Timers still running are not in it.
  std::vector<StageTime> times() const;

 private:
  friend class StageTimer;
  friend class WorkTimer;

  struct Stage {
    StageTime time;
    unsigned running = 0;      // timers
    double running_since = 0;  // valid while running > 0
  };

  Stage& stage_locked(const std::string& name);
  void begin(const std::string& stage);
  void end(const std::string& stage, double cpu_s);
  double attributed_s() const;

  mutable std::mutex mutex_;  // guards all below
  std::vector<Stage> stages_;
  std::map<std::string, std::size_t> index_;
  double attributed_s_ = 0;  // CPU seconds given to any stage
};

/// Measures a stage that has the process for itself: wall time and the CPU time of all threads,
/// less what timers inside it gave to other stages. May be nested. Not to be opened inside a
/// WorkTimer.
class StageTimer {
 public:
  StageTimer(StageClock& clock, std::string stage);
  ~StageTimer();
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  StageClock& clock_;
  const std::string stage_;
  double process_start_s_ = 0;
  double attributed_start_s_ = 0;
};

/// Measures one piece of a stage whose pieces run beside others: the CPU time of this thread alone.
/// Must end in the thread it began in. May be nested: the outer one then does not count what the
/// inner one did.
class WorkTimer {
 public:
  WorkTimer(StageClock& clock, std::string stage);
  ~WorkTimer();
  WorkTimer(const WorkTimer&) = delete;
  WorkTimer& operator=(const WorkTimer&) = delete;

 private:
  StageClock& clock_;
  const std::string stage_;
  WorkTimer* const outer_;  // the timer that was innermost in this thread
  double thread_start_s_ = 0;
  double inner_s_ = 0;  // counted by timers inside this one
};

double process_cpu_seconds() noexcept;  ///< of all threads since the process began
double thread_cpu_seconds() noexcept;   ///< of the calling thread
double wall_seconds() noexcept;         ///< monotonic, from an arbitrary start

/// The most memory the process ever had resident, in bytes (what `/usr/bin/time -v` shows).
std::uint64_t peak_rss_bytes() noexcept;

}  // namespace pounce
