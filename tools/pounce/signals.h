// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pounce/progress.h"

namespace pounce::cli {

/// From here on SIGINT, SIGTERM and SIGHUP (unless it is ignored, as under nohup) cancel the job
/// that runs; without one, or as a second wish, they end the process at once, with status 130. To
/// be called as early as can be; a second call changes nothing.
void handle_signals() noexcept;

/// While it lives, this is the job that runs.
class SignalsCancel {
 public:
  explicit SignalsCancel(Progress& progress);
  ~SignalsCancel();
  SignalsCancel(const SignalsCancel&) = delete;
  SignalsCancel& operator=(const SignalsCancel&) = delete;
};

}  // namespace pounce::cli
