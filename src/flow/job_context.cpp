// SPDX-License-Identifier: Apache-2.0
#include "flow/job_context.h"

#include <algorithm>

namespace pounce::flow {
Meter::Meter(Progress* progress)
    : progress_(progress), start_(std::chrono::steady_clock::now()), last_(start_) {}

void Meter::begin(const std::string& stage, std::uint64_t total, const std::string& unit,
                  double end) {
  const std::lock_guard lock(mutex_);
  event_.stage = stage;
  event_.done = 0;
  event_.total = total;
  event_.unit = unit;
  stage_start_ = event_.fraction;
  stage_end_ = std::max(end, stage_start_);
  emit(true);
}

void Meter::throw_if_cancelled() const {
  if (progress_ != nullptr && progress_->cancelled()) {
    throw Error(ErrorKind::cancelled,
                "stopped; nothing half-written is left, run the same command to start again");
  }
}

void Meter::wait(const std::string& what) {
  throw_if_cancelled();
  const std::lock_guard lock(mutex_);
  const bool begins = event_.stage != what;
  if (begins) {
    if (!interrupted_) interrupted_ = event_;
    event_.stage = what;
    event_.done = event_.total = 0;
  }
  emit(begins);
}

void Meter::resume() {
  const std::lock_guard lock(mutex_);
  if (!interrupted_) return;
  event_ = *interrupted_;
  interrupted_.reset();
  emit(true);
}

void Meter::advance(std::uint64_t units) {
  throw_if_cancelled();
  const std::lock_guard lock(mutex_);
  event_.done = std::min(event_.done + units, std::max(event_.total, event_.done));
  if (event_.total > 0) {
    const double part = static_cast<double>(event_.done) / static_cast<double>(event_.total);
    event_.fraction = std::max(event_.fraction, stage_start_ + (stage_end_ - stage_start_) * part);
  }
  emit(false);
}

void Meter::end() {
  const std::lock_guard lock(mutex_);
  event_.done = event_.total;
  event_.fraction = std::max(event_.fraction, stage_end_);
  emit(true);
}

void Meter::emit(bool always) {
  if (progress_ == nullptr || !progress_->on_event) return;
  const auto now = std::chrono::steady_clock::now();
  if (!always && now - last_ < std::chrono::milliseconds(200)) return;
  last_ = now;
  event_.elapsed_s = std::chrono::duration<double>(now - start_).count();
  progress_->on_event(event_);
}

std::unique_ptr<tiles::PackReader> JobContext::find_pack(tiles::PackKind kind, const Hash128& key) {
  std::string warning;
  auto pack = stores->find(kind, key, &warning);
  waiting.reset();
  meter.resume();
  if (!warning.empty()) report.warnings.push_back(warning);
  return pack;
}

}  // namespace pounce::flow
