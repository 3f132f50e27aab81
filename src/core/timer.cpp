// SPDX-License-Identifier: Apache-2.0
//
// Stages run beside each other on shared threads, and one may open another inside. Yet the table of
// a report must add up to the process's CPU time. So time is given away once: a timer subtracts
// what timers inside it gave to others. For a WorkTimer "inside" is on the same thread, known by a
// thread-local pointer to the innermost one; for a StageTimer, which has the process for itself, it
// is all that the clock was given meanwhile.
//
// Clocks are read where stages and pieces of work begin and end, never per texel: reading one is a
// system call or nearly so.
#include "core/timer.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>
#include <utility>

namespace pounce {
namespace {

thread_local WorkTimer* innermost = nullptr;

double seconds_of(clockid_t clock) noexcept {
  timespec now{};
  ::clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// "VmHWM" of /proc/self/status; 0 where that is not to be had. Allocates nothing: memory may be
/// what has run out.
std::uint64_t high_water_kib() noexcept {
  constexpr std::string_view kName = "\nVmHWM:";
  std::array<char, 8192> buffer{};
  const int file = ::open("/proc/self/status", O_RDONLY | O_CLOEXEC);
  if (file < 0) return 0;
  const ssize_t got = ::read(file, buffer.data(), buffer.size());
  ::close(file);
  const std::string_view status(buffer.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  const std::size_t line = status.find(kName);
  if (line == std::string_view::npos) return 0;
  const std::size_t digits = status.find_first_not_of(" \t", line + kName.size());
  std::uint64_t kib = 0;
  if (digits != std::string_view::npos)
    std::from_chars(status.data() + digits, status.data() + status.size(), kib);
  return kib;
}

}  // namespace

double process_cpu_seconds() noexcept { return seconds_of(CLOCK_PROCESS_CPUTIME_ID); }
double thread_cpu_seconds() noexcept { return seconds_of(CLOCK_THREAD_CPUTIME_ID); }
double wall_seconds() noexcept { return seconds_of(CLOCK_MONOTONIC); }

std::uint64_t peak_rss_bytes() noexcept {
  // That of getrusage() outlives exec(): it may be the size of whatever program started this one.
  std::uint64_t kib = high_water_kib();
  if (kib == 0) {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    kib = static_cast<std::uint64_t>(usage.ru_maxrss);  // Linux counts in KiB
  }
  return kib * 1024;
}

// Stages are told in the order in which they were first met, which is the order of the job.
StageClock::Stage& StageClock::stage_locked(const std::string& name) {
  const auto [place, is_new] = index_.try_emplace(name, stages_.size());
  if (is_new) {
    stages_.emplace_back();
    stages_.back().time.name = name;
  }
  return stages_[place->second];
}

void StageClock::add_cpu(const std::string& stage, double seconds) {
  const std::lock_guard lock(mutex_);
  stage_locked(stage).time.cpu_s += seconds;
  attributed_s_ += seconds;
}

void StageClock::set_cached(const std::string& stage) {
  const std::lock_guard lock(mutex_);
  stage_locked(stage).time.cached = true;
}

std::vector<StageTime> StageClock::times() const {
  const std::lock_guard lock(mutex_);
  std::vector<StageTime> times;
  for (const Stage& stage : stages_) times.push_back(stage.time);
  return times;
}

void StageClock::begin(const std::string& stage) {
  const std::lock_guard lock(mutex_);
  Stage& entry = stage_locked(stage);
  // Wall time of pieces that run side by side is the time while any of them runs.
  if (entry.running++ == 0) entry.running_since = wall_seconds();
}

void StageClock::end(const std::string& stage, double cpu_s) {
  const std::lock_guard lock(mutex_);
  Stage& entry = stage_locked(stage);
  if (--entry.running == 0) entry.time.wall_s += wall_seconds() - entry.running_since;
  entry.time.cpu_s += cpu_s;
  attributed_s_ += cpu_s;
}

double StageClock::attributed_s() const {
  const std::lock_guard lock(mutex_);
  return attributed_s_;
}

StageTimer::StageTimer(StageClock& clock, std::string stage)
    : clock_(clock), stage_(std::move(stage)) {
  clock_.begin(stage_);
  attributed_start_s_ = clock_.attributed_s();
  process_start_s_ = process_cpu_seconds();
}

StageTimer::~StageTimer() {
  // Clocks of threads and of the process are read at different moments: the difference of two may
  // fall a little below zero.
  const double used = process_cpu_seconds() - process_start_s_;
  const double elsewhere = clock_.attributed_s() - attributed_start_s_;
  clock_.end(stage_, std::max(0.0, used - elsewhere));
}

WorkTimer::WorkTimer(StageClock& clock, std::string stage)
    : clock_(clock), stage_(std::move(stage)), outer_(innermost) {
  clock_.begin(stage_);
  innermost = this;
  thread_start_s_ = thread_cpu_seconds();
}

WorkTimer::~WorkTimer() {
  const double used = thread_cpu_seconds() - thread_start_s_;
  innermost = outer_;
  if (outer_ != nullptr) outer_->inner_s_ += used;  // all of it, what is inside this one included
  clock_.end(stage_, std::max(0.0, used - inner_s_));
}

}  // namespace pounce
