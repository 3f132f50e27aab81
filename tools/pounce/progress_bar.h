// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>
#include <map>
#include <set>
#include <string>

#include "pounce/progress.h"

namespace pounce::cli {

enum class ProgressKind : std::uint8_t { automatic, bar, plain, json, openjd, none };

/// "auto", "plain", "json", "openjd" or "none"; throws Error(usage).
ProgressKind parse_progress_kind(const std::string& option, const std::string& text);
/// What `automatic` means here: a bar when `out` is a terminal that can rewrite a line, else plain
/// lines. Others stay as they are.
ProgressKind choose_kind(ProgressKind asked, std::FILE* out);
/// Seconds of a clock that never goes back.
double monotonic_seconds();

/// Estimates the time left from the share that is done. Smoothed: the speed is an average that
/// forgets with a time constant of some seconds, so one slow moment does not make the figure jump.
class TimeLeft {
 public:
  /// fraction in 0..1 after elapsed_s seconds, of which `kept` took no work; none of them falls.
  void update(double fraction, double kept, double elapsed_s);
  /// Seconds; negative as long as nothing can be said.
  double seconds() const;

 private:
  double fraction_ = 0, elapsed_s_ = 0;
  double worked_ = 0;  ///< of it, at elapsed_s_
  double share_per_s_ = 0;
  bool started_ = false;
};

/// What a line of progress says beside the event itself.
struct ProgressFigures {
  double units_per_s = 0;  ///< of the current stage; 0 = unknown
  double left_s = -1;      ///< negative = unknown
};

/// One line without line end, at most `columns` characters: the bar, rate and time left give way in
/// that order on narrow terminals.
std::string bar_line(const ProgressEvent& event, const ProgressFigures& figures,
                     std::size_t columns);
std::string plain_line(const ProgressEvent& event, const ProgressFigures& figures);
std::string json_line(const ProgressEvent& event, const ProgressFigures& figures);
/// As a worker of Open Job Description reads it from the standard output: two lines.
std::string openjd_lines(const ProgressEvent& event, const ProgressFigures& figures);

/// Shows progress on `out`. Not thread-safe: the library makes one call at a time.
class ProgressBar {
 public:
  ProgressBar(ProgressKind kind, std::FILE* out) : kind_(kind), out_(out) {}
  ~ProgressBar() { finish(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void show(ProgressEvent event);
  /// Erases the bar, so that what is printed next starts on a clean line.
  void finish();

 private:
  struct StageStart {
    double elapsed_s = 0;
    std::uint64_t done = 0;
  };
  ProgressFigures figures(const ProgressEvent& event);
  void show_bar(const ProgressEvent& event, const ProgressFigures& figures);
  void show_plain(const ProgressEvent& event, const ProgressFigures& figures);

  ProgressKind kind_;
  std::FILE* out_;
  TimeLeft time_left_;
  std::map<std::string, StageStart> stages_;
  std::set<std::string> ended_;  ///< stages whose last plain line is out
  double last_shown_s_ = -1e9;
  bool on_screen_ = false;
};

}  // namespace pounce::cli
