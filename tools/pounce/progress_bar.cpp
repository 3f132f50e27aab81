// SPDX-License-Identifier: Apache-2.0
#include "progress_bar.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "pounce/error.h"
#include "terminal.h"

namespace pounce::cli {
namespace {

constexpr double kBarIntervalS = 0.1;    // ten times a second: smooth, and no flood over slow links
constexpr double kPlainIntervalS = 5;    // few enough lines for a log of an hour's job
constexpr double kForgettingS = 8;       // time constant of the speed behind "time left"
constexpr double kFirstEstimateS = 0.5;  // before that the speed is a guess
constexpr double kShortestS = 0.1;       // the rate of a shorter stage says nothing
constexpr std::size_t kUsualColumns = 80;
constexpr std::size_t kWidestBar = 40;
constexpr std::size_t kNarrowestBar = 8;

std::size_t terminal_columns(std::FILE* out) {
  winsize size = {};
  if (ioctl(fileno(out), TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kUsualColumns;
  return size.ws_col;
}

std::string percent(double fraction) {
  // Rounded down: 100 % means finished.
  return fmt::format("{:3.0f} %", std::floor(std::clamp(fraction, 0.0, 1.0) * 100));
}

std::string rate(const ProgressEvent& event, double units_per_s) {
  if (!(units_per_s > 0) || event.unit.empty()) return "";
  constexpr const char* kPrefixes[] = {"", "k", "M", "G", "T"};
  std::size_t prefix = 0;
  while (units_per_s >= 1000 && prefix + 1 < std::size(kPrefixes)) {
    units_per_s /= 1000;
    ++prefix;
  }
  const int digits = units_per_s < 10 ? 1 : 0;
  return fmt::format("{:.{}f} {}{}/s", units_per_s, digits, kPrefixes[prefix], event.unit);
}

std::string clock_time(double seconds) {
  const auto whole = static_cast<std::uint64_t>(std::ceil(std::min(seconds, 3.6e8)));
  const std::uint64_t minutes = whole / 60;
  if (minutes < 60) return fmt::format("{}:{:02}", minutes, whole % 60);
  return fmt::format("{}:{:02}:{:02}", minutes / 60, minutes % 60, whole % 60);
}

std::string left(double left_s) { return left_s < 0 ? "" : clock_time(left_s) + " left"; }

/// Progress that cannot be shown (closed, disk full) is no reason to stop a job, so nothing is
/// thrown.
void say(std::FILE* out, const std::string& text) {
  std::fputs(text.c_str(), out);
  std::fflush(out);
}

}  // namespace

ProgressKind parse_progress_kind(const std::string& option, const std::string& text) {
  if (text == "auto") return ProgressKind::automatic;
  if (text == "plain") return ProgressKind::plain;
  if (text == "json") return ProgressKind::json;
  if (text == "openjd") return ProgressKind::openjd;
  if (text == "none") return ProgressKind::none;
  throw Error(
      ErrorKind::usage,
      fmt::format("{}: got \"{}\", expected auto, plain, json, openjd or none", option, text));
}

ProgressKind choose_kind(ProgressKind asked, std::FILE* out) {
  if (asked != ProgressKind::automatic) return asked;
  const char* const terminal = std::getenv("TERM");
  const bool can_rewrite = terminal != nullptr && std::string_view(terminal) != "dumb";
  return isatty(fileno(out)) == 1 && can_rewrite ? ProgressKind::bar : ProgressKind::plain;
}

double monotonic_seconds() {
  using Clock = std::chrono::steady_clock;
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

void TimeLeft::update(double fraction, double kept, double elapsed_s) {
  const double step_s = elapsed_s - elapsed_s_;
  fraction_ = std::max(fraction_, fraction);
  if (!(step_s > 0)) return;
  const double worked = fraction_ - kept;
  const double speed = std::max(0.0, worked - worked_) / step_s;
  // The average since the start is the best first value; from then on old speeds fade.
  const double keep = started_ ? std::exp(-step_s / kForgettingS) : 0;
  share_per_s_ = keep * share_per_s_ + (1 - keep) * speed;
  started_ = started_ || elapsed_s >= kFirstEstimateS;
  if (!started_) return;  // keep measuring from the start
  worked_ = std::max(worked_, worked);
  elapsed_s_ = elapsed_s;
}

double TimeLeft::seconds() const {
  if (!started_ || !(share_per_s_ > 0)) return -1;
  return std::max(0.0, 1 - fraction_) / share_per_s_;
}

std::string bar_line(const ProgressEvent& event, const ProgressFigures& figures,
                     std::size_t columns) {
  std::string line = fmt::format("{:<12} {}", event.stage, percent(event.fraction));
  for (const std::string& part : {left(figures.left_s), rate(event, figures.units_per_s)}) {
    if (!part.empty() && line.size() + 2 + part.size() <= columns) line += "  " + part;
  }
  // The bar takes what is left of the line, in front of the percentage.
  const std::size_t room = columns > line.size() + 3 ? columns - line.size() - 3 : 0;
  if (room >= kNarrowestBar) {
    const std::size_t width = std::min(room, kWidestBar);
    const double share = std::clamp(event.fraction, 0.0, 1.0);
    const auto full = static_cast<std::size_t>(share * static_cast<double>(width));
    const std::size_t after_stage = std::max<std::size_t>(event.stage.size(), 12) + 1;
    line.insert(after_stage, fmt::format("[{:#<{}}{:.<{}}] ", "", full, "", width - full));
  }
  if (line.size() > columns) line.resize(columns);
  return line;
}

std::string plain_line(const ProgressEvent& event, const ProgressFigures& figures) {
  std::string line = fmt::format("{}: {}", event.stage, percent(event.fraction));
  if (event.total > 0) line += fmt::format(", {}/{} {}", event.done, event.total, event.unit);
  for (const std::string& part : {rate(event, figures.units_per_s), left(figures.left_s)}) {
    if (!part.empty()) line += ", " + part;
  }
  return line;
}

std::string json_line(const ProgressEvent& event, const ProgressFigures& figures) {
  nlohmann::ordered_json line;
  line["stage"] = event.stage;
  line["fraction"] = event.fraction;
  line["done"] = event.done;
  line["total"] = event.total;
  line["unit"] = event.unit;
  line["elapsed_s"] = event.elapsed_s;
  line["left_s"] = nullptr;
  if (figures.left_s >= 0) line["left_s"] = figures.left_s;
  return line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

std::string openjd_lines(const ProgressEvent& event, const ProgressFigures& figures) {
  return fmt::format("openjd_progress: {:.1f}\nopenjd_status: {}\n",
                     std::clamp(event.fraction, 0.0, 1.0) * 100, plain_line(event, figures));
}

ProgressFigures ProgressBar::figures(const ProgressEvent& event) {
  time_left_.update(event.fraction, event.kept, event.elapsed_s);
  const auto [stage, is_new] =
      stages_.try_emplace(event.stage, StageStart{event.elapsed_s, event.done});
  const double stage_s = event.elapsed_s - stage->second.elapsed_s;
  const double units =
      event.done > stage->second.done ? static_cast<double>(event.done - stage->second.done) : 0;
  return {!is_new && stage_s >= kShortestS ? units / stage_s : 0, time_left_.seconds()};
}

void ProgressBar::show(ProgressEvent event) {
  if (kind_ == ProgressKind::none) return;
  event.stage = visible_line(event.stage);  // it may quote a file of the cache
  const ProgressFigures now = figures(event);
  switch (kind_) {
    case ProgressKind::json:
      say(out_, json_line(event, now) + "\n");
      break;
    case ProgressKind::plain:
    case ProgressKind::openjd:
      show_plain(event, now);
      break;
    default:
      show_bar(event, now);
  }
}

void ProgressBar::show_bar(const ProgressEvent& event, const ProgressFigures& now) {
  if (event.elapsed_s - last_shown_s_ < kBarIntervalS && event.done != event.total) return;
  last_shown_s_ = event.elapsed_s;
  // One column stays free: some terminals wrap when the last one is written.
  const std::size_t columns = terminal_columns(out_);
  say(out_, "\r" + bar_line(event, now, columns > 1 ? columns - 1 : 1) + "\033[K");
  on_screen_ = true;
}

void ProgressBar::show_plain(const ProgressEvent& event, const ProgressFigures& now) {
  const bool stage_ends = event.total > 0 && event.done >= event.total;
  if (stage_ends ? !ended_.insert(event.stage).second
                 : event.elapsed_s - std::max(last_shown_s_, 0.0) < kPlainIntervalS) {
    return;
  }
  last_shown_s_ = event.elapsed_s;
  if (kind_ == ProgressKind::openjd) return say(stdout, openjd_lines(event, now));
  say(out_, plain_line(event, now) + "\n");
}

void ProgressBar::finish() {
  if (!on_screen_) return;
  std::fputs("\r\033[K", out_);
  std::fflush(out_);
  on_screen_ = false;
}

}  // namespace pounce::cli
