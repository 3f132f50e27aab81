// SPDX-License-Identifier: Apache-2.0
#include "signals.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <ctime>

#include "pounce/error.h"

namespace pounce::cli {
namespace {

// What the signal handler may touch.
std::atomic<Progress*> running_job{nullptr};
std::atomic<std::int64_t> stopped_ms{0};
static_assert(std::atomic<Progress*>::is_always_lock_free);
static_assert(std::atomic<std::int64_t>::is_always_lock_free);

/// timeout(1) and other supervisors signal the process and then its group: that is one wish.
constexpr std::int64_t kSameWishMs = 500;

std::int64_t now_ms() {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1000 + now.tv_nsec / 1'000'000;
}

extern "C" void stop_job(int) {
  const int before = errno;
  Progress* const progress = running_job.load();
  if (progress == nullptr) _exit(exit_status(ErrorKind::cancelled));
  if (!progress->cancelled()) {
    stopped_ms = now_ms();
    progress->cancel();
  } else if (now_ms() - stopped_ms > kSameWishMs) {
    _exit(exit_status(ErrorKind::cancelled));
  }
  errno = before;
}

}  // namespace

void handle_signals() noexcept {
  struct sigaction action = {};
  action.sa_handler = stop_job;
  action.sa_flags = SA_RESTART;  // no read or write of a library fails for a signal
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before = {};
    const bool outlives_terminal = signal == SIGHUP && sigaction(signal, nullptr, &before) == 0 &&
                                   before.sa_handler == SIG_IGN;
    if (!outlives_terminal) sigaction(signal, &action, nullptr);
  }
}

SignalsCancel::SignalsCancel(Progress& progress) { running_job = &progress; }
SignalsCancel::~SignalsCancel() { running_job = nullptr; }

}  // namespace pounce::cli
