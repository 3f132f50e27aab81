// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "job_folder.h"
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
  bool plan_only = false;        ///< print the plan instead of the summary
  bool prepares = false;         ///< stores alone
  bool redo = false;             ///< make again what this very job has made
  std::shared_ptr<TaskLog> log;  ///< of a task, which says how it stands
  std::string who;               ///< of a task, for its messages: "host n2, task 3 of 20"
};

/// Runs a job with progress on the standard error output and signals wired to its cancellation
/// (terminal.h); then writes the report and says what was done, also of a job that throws. Returns
/// the exit status: 0, or 1 where a target found less than it was to. Throws what the job throws,
/// but with JSON lines, where the last one says it, returns its status. One job at a time in a
/// process.
int run_job(const JobSettings& settings, const std::function<void(Progress*, Report*)>& job);

/// Writes the report of what failed. That it cannot be written is a warning: it does not hide why.
void write_failed_report(const std::string& path, ProgressKind kind, Report& report);

// --- what is said of a job -----------------------------------------------------------------------

/// What is said of a finished job, as text with line ends.
std::string prepared_text(const Report& report, double wall_s);  ///< of stores alone
std::string summary_text(const Report& report, double wall_s);   ///< outputs, texels, time
std::string details_text(const Report& report);                  ///< -v: stages, memory, tiles
std::string plan_text(const Report& report);                     ///< --plan
std::string warnings_text(const Report& report);
/// One {"warning": text} or {"note": text} per line.
std::string warnings_json(const Report& report);
/// The last line of --progress json: how the job ended.
std::string end_line(const Report& report, int status);
/// A line for each target that found less than --min-coverage.
std::string too_little_text(const Report& report);

/// 12345678 -> "12,345,678".
std::string with_commas(std::uint64_t count);
/// 1536 -> "1.5 KiB"; exact below 1024 bytes.
std::string bytes_text(std::uint64_t bytes);

}  // namespace pounce::cli
