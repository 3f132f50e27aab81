// SPDX-License-Identifier: Apache-2.0
#include "job.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <new>

#include "pounce/error.h"
#include "summary.h"
#include "terminal.h"

namespace pounce::cli {
namespace {

constexpr int kBelow = 1;  // exit status, see the README

std::string folder_of(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

[[noreturn]] void cannot(const std::string& what, const std::string& path) {
  const int reason = errno;
  throw Error(ErrorKind::storage, fmt::format("{}: {}: {}", path, what, std::strerror(reason)));
}

/// Devices, pipes and links (/dev/stdout, /dev/fd/3, /dev/null) are written into: a rename would
/// put a file in their place, on the whole machine if the user may.
bool is_written_in_place(const std::string& path) {
  struct stat there = {};
  return lstat(path.c_str(), &there) == 0 && !S_ISREG(there.st_mode);
}

/// A report that cannot be written is better known before a long job than after it.
void check_report_folder(const std::string& path) {
  if (path.empty() || path == "-") return;
  std::filesystem::path folder = folder_of(path);  // or what is there of it: the rest is made
  for (std::error_code gone; !std::filesystem::exists(folder, gone);)
    folder = folder.has_parent_path() ? folder.parent_path() : ".";
  if (!is_written_in_place(path) && access(folder.c_str(), W_OK | X_OK) != 0) {
    cannot("cannot write the report into its folder", path);
  }
  if (std::error_code ignored; std::filesystem::is_directory(path, ignored)) {
    errno = EISDIR;
    cannot("cannot write the report", path);
  }
}

void write_in_place(const std::string& path, const std::string& text) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) cannot("cannot create the report", path);
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t count = write(file, text.data() + written, text.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) break;
    written += static_cast<std::size_t>(count);
  }
  const int reason = errno;
  if (close(file) == 0 && written == text.size()) return;
  if (written < text.size()) errno = reason;
  cannot("cannot write the report", path);
}

/// To the standard output, a file or nowhere.
void write_report(const std::string& path, const Report& report) {
  if (path == "-") {
    write_stdout(to_json(report));
  } else if (is_written_in_place(path)) {
    write_in_place(path, to_json(report));
  } else if (!path.empty()) {
    save_report(report, path);
  }
}

/// Of what the library did not turn into an error of its own.
Failure failure_of(const std::exception& error) {
  const bool no_memory = dynamic_cast<const std::bad_alloc*>(&error) != nullptr;
  const auto* known = dynamic_cast<const Error*>(&error);
  const ErrorKind kind = known != nullptr ? known->kind()
                         : no_memory      ? ErrorKind::budget
                                          : ErrorKind::internal;
  return {error_kind_name(kind), exit_status(kind), no_memory ? "out of memory" : error.what()};
}

bool has_enough(const Report& report) {
  return std::all_of(report.targets.begin(), report.targets.end(),
                     [](const TargetReport& target) { return target.enough; });
}

}  // namespace

void write_failed_report(const std::string& path, ProgressKind kind, Report& report) {
  try {
    write_report(path, report);
  } catch (const Error& error) {
    if (kind == ProgressKind::json) {
      report.warnings.push_back(error.what());
    } else {
      write_stderr(fmt::format("pounce: warning: {}\n", visible_line(error.what())));
    }
  }
}

int run_job(const JobSettings& settings, const std::function<void(Progress*, Report*)>& job) {
  Progress progress;
  const SignalsCancel signals(progress);
  const ProgressKind kind =
      settings.quiet ? ProgressKind::none : choose_kind(settings.progress, own_stderr());
  ProgressBar bar(kind, own_stderr());
  progress.on_event = [&bar](const ProgressEvent& event) { bar.show(event); };

  Report report;
  double wall_s = 0;
  int status = 0;
  bool is_of_report = true;  // what is done now: it would only fail again
  try {
    check_report_folder(settings.report_path);
    is_of_report = false;
    const double begin_s = monotonic_seconds();
    job(&progress, &report);
    wall_s = monotonic_seconds() - begin_s;
    bar.finish();
    status = has_enough(report) ? 0 : kBelow;
    is_of_report = true;
    write_report(settings.report_path, report);
    if (settings.plan_only && settings.report_path != "-") write_stdout(plan_text(report));
  } catch (const std::exception& error) {
    bar.finish();
    if (!report.failure) report.failure = failure_of(error);
    if (!is_of_report) write_failed_report(settings.report_path, kind, report);
    if (kind != ProgressKind::json) {
      // What was noticed until then may be why.
      if (!settings.quiet) write_stderr(warnings_text(report));
      throw;
    }
    write_stderr(warnings_json(report) + end_line(report, report.failure->exit_status));
    return report.failure->exit_status;
  }
  // A program that reads JSON lines gets nothing else; the report has the figures.
  if (kind == ProgressKind::json) {
    write_stderr(warnings_json(report) + end_line(report, status));
  } else if (!settings.quiet) {
    std::string said = warnings_text(report);
    if (!settings.plan_only) said += summary_text(report, wall_s);
    if (!settings.plan_only && settings.verbose) said += details_text(report);
    write_stderr(said);
  }
  if (kind != ProgressKind::json) write_stderr(too_little_text(report));
  return status;
}

}  // namespace pounce::cli
