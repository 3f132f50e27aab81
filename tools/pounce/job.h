// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "pounce/progress.h"
#include "pounce/report.h"
#include "progress_bar.h"

namespace pounce::cli {

/// How a long job talks to the user.
struct JobSettings {
  std::string report_path;  ///< empty: no report; "-": standard output
  ProgressKind progress = ProgressKind::automatic;
  bool quiet = false;
  bool verbose = false;
  bool plan_only = false;  ///< print the plan instead of the summary
};

/// Runs a job with progress on the standard error output and signals wired to its cancellation
/// (terminal.h); then writes the report and says what was done, also of a job that throws. Returns
/// the exit status: 0, or 1 where a target found less than it was to. Throws what the job throws,
/// but with JSON lines, where the last one says it, returns its status. One job at a time in a
/// process.
int run_job(const JobSettings& settings, const std::function<void(Progress*, Report*)>& job);

/// Writes the report of what failed. That it cannot be written is a warning: it does not hide why.
void write_failed_report(const std::string& path, ProgressKind kind, Report& report);

}  // namespace pounce::cli
