// SPDX-License-Identifier: Apache-2.0
//
// A bar that never goes back. Stages begin and end in an order that the options decide, some need
// no work because their result is in the cache, and after a damaged pack the whole job begins
// again. So only raise() writes the fraction, and it takes the larger of two; a job that begins
// again shares what is left of the bar.
//
// on_event() runs with the lock held: events come one at a time and in order, in whatever thread
// made progress. Whoever listens may throw; that stops the job as a wish of the caller's and not as
// an error of the job's.
#include "runtime/meter.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>

#include "pounce/error.h"

namespace pounce::runtime {
namespace {

/// Tells the caller. What a listener throws stops the job, but is no error of the job's: it leaves
/// as Error(cancelled), nested in it what was thrown.
void tell(const Progress& progress, const ProgressEvent& event) {
  try {
    progress.on_event(event);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    std::throw_with_nested(Error(ErrorKind::cancelled,
                                 fmt::format("stopped: Progress::on_event threw: {}", e.what())));
  } catch (...) {
    std::throw_with_nested(
        Error(ErrorKind::cancelled, "stopped: Progress::on_event threw an unknown exception"));
  }
}

}  // namespace

Meter::Meter(Progress* progress)
    : progress_(progress), start_(std::chrono::steady_clock::now()), last_(start_) {}

void Meter::begin(const std::string& stage, std::uint64_t total, const std::string& unit,
                  double end) {
  const std::lock_guard lock(mutex_);
  stage_ = {stage, 0, total, unit, fraction_, restarted_ + (1 - restarted_) * end};
  emit(true);
}

void Meter::throw_if_cancelled() const {
  if (progress_ != nullptr && progress_->cancelled()) {
    throw Error(ErrorKind::cancelled,
                "stopped; run the same command again to go on from what is finished");
  }
}

void Meter::wait(const std::string& what) {
  throw_if_cancelled();
  const std::lock_guard lock(mutex_);
  // Said at once when it begins, then as often as progress.
  const bool begins = waiting_ != what;
  waiting_ = what;
  emit(begins);
}

void Meter::resume() {
  const std::lock_guard lock(mutex_);
  if (waiting_.empty()) return;
  waiting_.clear();
  emit(true);
}

void Meter::advance(std::uint64_t units) {
  throw_if_cancelled();
  const std::lock_guard lock(mutex_);
  stage_.done = std::min(stage_.done + units, std::max(stage_.total, stage_.done));
  if (stage_.total > 0) {
    const double part = static_cast<double>(stage_.done) / static_cast<double>(stage_.total);
    raise(stage_.start + (stage_.end - stage_.start) * part);
  }
  emit(false);
}

void Meter::end(bool kept) {
  const std::lock_guard lock(mutex_);
  stage_.done = stage_.total;
  raise(stage_.end, kept);
  emit(true);
}

void Meter::keep(double end) {
  const std::lock_guard lock(mutex_);
  raise(restarted_ + (1 - restarted_) * end, true);
}

void Meter::restart() {
  const std::lock_guard lock(mutex_);
  restarted_ = fraction_;
  stage_ = {};
  waiting_.clear();
}

void Meter::finish() {
  const std::lock_guard lock(mutex_);
  stage_.done = stage_.total;
  raise(1);
  emit(true);
}

void Meter::raise(double fraction, bool kept) {
  const double before = fraction_;
  fraction_ = std::max(fraction_, std::min(fraction, 1.0));
  if (kept) kept_ += fraction_ - before;
}

void Meter::emit(bool always) {
  if (progress_ == nullptr || !progress_->on_event) return;
  const auto now = std::chrono::steady_clock::now();
  // Some pieces take microseconds: five times a second is as often as anybody reads a bar.
  if (!always && now - last_ < std::chrono::milliseconds(200)) return;
  last_ = now;
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  if (waiting_.empty()) {
    tell(*progress_,
         {stage_.name, fraction_, stage_.done, stage_.total, stage_.unit, elapsed_s, kept_});
  } else {
    tell(*progress_, {waiting_, fraction_, 0, 0, stage_.unit, elapsed_s, kept_});
  }
}

}  // namespace pounce::runtime
