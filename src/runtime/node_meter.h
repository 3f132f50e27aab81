// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>

#include "pounce/report.h"

namespace pounce::runtime {

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
