// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

namespace pounce {

/// A snapshot of a running job.
struct ProgressEvent {
  std::string stage;        ///< "precondition", "vectorize", "project", "write", ...
  double fraction = 0;      ///< of the whole job, 0..1; never falls within one job
  std::uint64_t done = 0;   ///< units of this stage that are finished
  std::uint64_t total = 0;  ///< units of this stage; 0 when unknown
  std::string unit;         ///< "texels", "rows", "blocks", ...
  double elapsed_s = 0;     ///< seconds since the job began
  /// Of `fraction`: what took no work, as it was up to date or in the cache. A pace is that of the
  /// rest: (fraction - kept) / elapsed_s.
  double kept = 0;
};

/// Progress and cancellation of one job, shared between the caller and the library.
/// Thread-safe: cancel() may be called from any thread and from a signal handler.
class Progress {
 public:
  /// Called from worker threads, one call at a time, a few times a second and as stages begin and
  /// end; may be empty. An exception ends the job as an Error(cancelled) that nests it.
  std::function<void(const ProgressEvent&)> on_event;

  /// Asks the job to stop. It ends with Error(ErrorKind::cancelled) as soon as the work in hand is
  /// finished, and leaves no half-written output.
  void cancel() noexcept { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const noexcept { return cancelled_.load(std::memory_order_relaxed); }

 private:
  std::atomic<bool> cancelled_{false};
};

}  // namespace pounce
