// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>

#include "pounce/progress.h"
#include "pounce/report.h"

namespace pounce::runtime {

/// Progress of a job as its stages report it, a few events a second. The fraction has one writer,
/// which only raises it, so it never falls: not for a stage that ends earlier than the one before,
/// not while other threads go on during a wait, not when the job begins again. Thread-safe.
class Meter {
 public:
  explicit Meter(Progress* progress);
  /// A new stage of `total` units that takes the job's fraction to `end`.
  void begin(const std::string& stage, std::uint64_t total, const std::string& unit, double end);
  /// `units` more are done. Throws Error(cancelled) if the caller asked to stop.
  void advance(std::uint64_t units);
  /// `kept`: the stage's result was there already; what is left of its share took no work.
  void end(bool kept = false);
  /// Work that would have taken the job's fraction to `end` need not be done.
  void keep(double end);
  /// Says in between that the job waits, and what for. Throws Error(cancelled) like advance().
  void wait(const std::string& what);
  /// The wait, if there was one, is over: back to the stage.
  void resume();
  void throw_if_cancelled() const;  ///< Error(cancelled)
  /// The job begins again: from here on 0 is where it stands and 1 stays the end.
  void restart();
  /// All is done: the fraction is 1.
  void finish();

 private:
  struct Stage {
    std::string name;
    std::uint64_t done = 0, total = 0;
    std::string unit;
    double start = 0, end = 0;  ///< of fraction_
  };
  void raise(double fraction, bool kept = false);
  void emit(bool always);

  Progress* progress_;
  const std::chrono::steady_clock::time_point start_;
  std::mutex mutex_;  ///< guards what follows, and is held during on_event
  std::chrono::steady_clock::time_point last_;
  Stage stage_;
  std::string waiting_;   ///< what is said instead of the stage; may be empty
  double fraction_ = 0;   ///< written by raise() alone
  double kept_ = 0;       ///< of it, what took no work
  double restarted_ = 0;  ///< where the job began again
};

/// Watches one node of a flow graph: how many works it did, how long they took, how many waited for
/// it at most, what it read or wrote. Thread-safe.
class NodeMeter {
 public:
  explicit NodeMeter(std::string name) : name_(std::move(name)) {}

  /// A work is on its way to the node.
  void sent() {
    const std::int64_t waiting = ++waiting_;
    std::int64_t most = most_waiting_;
    while (waiting > most && !most_waiting_.compare_exchange_weak(most, waiting)) {
    }
  }
  /// The node does a work that was sent to it.
  template <class Body>
  auto run(const Body& body) {
    using Clock = std::chrono::steady_clock;
    struct Count {
      NodeMeter& meter;
      const Clock::time_point begin = Clock::now();
      ~Count() {
        meter.busy_ns_ += std::chrono::nanoseconds(Clock::now() - begin).count();
        ++meter.runs_;
      }
    };
    --waiting_;
    const Count count{*this};
    return body();
  }
  void add_bytes(std::uint64_t bytes) { bytes_ += bytes; }
  void set_stalls(std::uint64_t count, double seconds) { stalls_ = count, stalled_s_ = seconds; }

  NodeReport report() const {
    return {name_,
            runs_,
            static_cast<std::uint64_t>(most_waiting_.load()),
            static_cast<double>(busy_ns_) * 1e-9,
            stalls_,
            stalled_s_,
            bytes_};
  }

 private:
  const std::string name_;
  std::atomic<std::int64_t> waiting_{0}, most_waiting_{0}, busy_ns_{0};
  std::atomic<std::uint64_t> runs_{0}, bytes_{0};
  std::uint64_t stalls_ = 0;
  double stalled_s_ = 0;
};

}  // namespace pounce::runtime
