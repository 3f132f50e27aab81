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
#include <map>
#include <new>
#include <nlohmann/json.hpp>
#include <utility>

#include "pounce/error.h"
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
  throw Error(ErrorKind::storage, fmt::format("{}: {}: {}", path, what, std::strerror(reason)),
              may_pass(reason));
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
  if (const auto* known = dynamic_cast<const Error*>(&error))
    return {error_kind_name(known->kind()), exit_status(*known), error.what()};
  const ErrorKind kind = no_memory ? ErrorKind::budget : ErrorKind::internal;
  return {error_kind_name(kind), exit_status(kind), no_memory ? "out of memory" : error.what()};
}

bool is_cancelled(const Failure& failure) {
  return failure.exit_status == exit_status(ErrorKind::cancelled);
}

bool has_enough(const Report& report) {
  return std::all_of(report.targets.begin(), report.targets.end(),
                     [](const TargetReport& target) { return target.enough; });
}

/// What goes wrong in one of a hundred tasks is read where all their messages come together.
void run_named(const JobSettings& settings, const std::function<void()>& job) {
  try {
    job();
  } catch (const Error& error) {
    if (settings.who.empty()) throw;
    throw Error(error.kind(), settings.who + ": " + error.what(), error.is_passing());
  }
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
  progress.on_event = [&](const ProgressEvent& event) {
    bar.show(event);
    if (settings.log != nullptr) settings.log->event(event);
  };

  Report report;
  double wall_s = 0;
  int status = 0;
  bool is_of_report = true;  // what is done now: it would only fail again
  try {
    check_report_folder(settings.report_path);
    is_of_report = false;
    const double begin_s = monotonic_seconds();
    run_named(settings, [&] { job(&progress, &report); });
    wall_s = monotonic_seconds() - begin_s;
    bar.finish();
    status = has_enough(report) ? 0 : kBelow;
    is_of_report = true;
    write_report(settings.report_path, report);
    if (settings.plan_only && settings.report_path != "-") write_stdout(plan_text(report));
  } catch (const std::exception& error) {
    bar.finish();
    if (!report.failure) report.failure = failure_of(error);
    if (is_cancelled(*report.failure)) report.failure->exit_status = stopped_status();
    if (settings.log != nullptr)
      settings.log->end(report, report.failure->exit_status, report.failure->message);
    if (!is_of_report) write_failed_report(settings.report_path, kind, report);
    if (kind == ProgressKind::openjd)
      write_stdout("openjd_fail: " + visible_line(report.failure->message) + "\n");
    if (kind != ProgressKind::json) {
      // What was noticed until then may be why.
      if (!settings.quiet) write_stderr(warnings_text(report));
      throw;
    }
    write_stderr(warnings_json(report) + end_line(report, report.failure->exit_status));
    return report.failure->exit_status;
  }
  if (settings.log != nullptr) settings.log->end(report, status, "");
  // A program that reads JSON lines gets nothing else; the report has the figures.
  if (kind == ProgressKind::json) {
    write_stderr(warnings_json(report) + end_line(report, status));
  } else if (!settings.quiet) {
    std::string said = warnings_text(report);
    if (settings.prepares) {
      said += prepared_text(report, wall_s);
    } else if (!settings.plan_only) {
      said += summary_text(report, wall_s);
    }
    if (!settings.plan_only && settings.verbose) said += details_text(report);
    write_stderr(said);
  }
  if (kind != ProgressKind::json) write_stderr(too_little_text(report));
  return status;
}

// --- what is said of a job -----------------------------------------------------------------------

namespace {

constexpr std::size_t kMostOutputsListed = 8;  // a folder of files is better counted than listed

std::string wall_text(double seconds) {
  if (seconds < 100) return fmt::format("{:.2f} s", seconds);
  const auto whole = static_cast<std::uint64_t>(seconds);
  return fmt::format("{} min {} s", whole / 60, whole % 60);
}

std::string share_text(std::uint64_t part, std::uint64_t whole) {
  if (whole == 0) return "";
  return fmt::format(" ({:.2f} %)", 100.0 * static_cast<double>(part) / static_cast<double>(whole));
}

/// The channel that is covered least; without a name where there is only one.
std::pair<std::string, TexelCounts> least_covered(const TargetReport& target) {
  std::map<std::string, TexelCounts> channels;
  for (const ImageReport& image : target.images) {
    if (image.state == "kept") continue;
    channels[image.channel].texels += image.counts.texels;
    channels[image.channel].covered += image.counts.covered;
  }
  if (channels.size() < 2) return {"", target.counts};
  const auto share = [](const TexelCounts& counts) {
    return counts.texels == 0
               ? 0.0
               : static_cast<double>(counts.covered) / static_cast<double>(counts.texels);
  };
  return *std::min_element(channels.begin(), channels.end(), [&](const auto& a, const auto& b) {
    return share(a.second) < share(b.second);
  });
}

/// What was left out of a scene and why, in words; empty where nothing was.
std::string left_out_text(const Report& report) {
  std::string text;
  std::uint64_t total = 0;
  for (const auto& [reason, words] : left_out_reasons()) {
    const auto found = report.source_filtered.find(reason);
    if (found == report.source_filtered.end()) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", with_commas(found->second), words);
    total += found->second;
  }
  if (total == 0) return "";
  return fmt::format("{} Gaussians left out: {}\n", with_commas(total), text);
}

}  // namespace

std::string with_commas(std::uint64_t count) {
  std::string text = std::to_string(count);
  for (std::size_t place = text.size(); place > 3;) {
    place -= 3;
    text.insert(place, 1, ',');
  }
  return text;
}

std::string bytes_text(std::uint64_t bytes) {
  constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB"};
  if (bytes < 1024) return fmt::format("{} B", bytes);
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (value >= 1024 && unit + 1 < std::size(kUnits)) {
    value /= 1024;
    ++unit;
  }
  return fmt::format("{:.1f} {}", value, kUnits[unit]);
}

std::string summary_text(const Report& report, double wall_s) {
  std::string text;
  const std::size_t listed = std::min(report.outputs.size(), kMostOutputsListed);
  for (std::size_t i = 0; i < listed; ++i)
    text += fmt::format("wrote {}\n", visible_line(report.outputs[i]));
  if (listed < report.outputs.size()) {
    text += fmt::format("wrote {} more\n", report.outputs.size() - listed);
  }
  if (report.command == "gaussians") {
    text += fmt::format("{} Gaussians\n", with_commas(report.source_gaussians));
    text += left_out_text(report);
    return text + fmt::format("{}, {} threads\n", wall_text(wall_s), report.threads);
  }
  if (report.command == "proxy" && report.targets.empty()) {
    text += left_out_text(report);
    return text + fmt::format("{}, {} threads\n", wall_text(wall_s), report.threads);
  }
  if (!report.kept.empty())
    text += fmt::format("skipped {} file{} (up to date); --redo makes them again\n",
                        report.kept.size(), report.kept.size() == 1 ? "" : "s");
  const std::uint64_t texels = report.target_texels;
  if (texels > 0 || report.kept.empty()) {
    text += fmt::format("{} texels: {} covered{}, {} empty{}; {} filled around the charts\n",
                        with_commas(texels), with_commas(report.target_covered),
                        share_text(report.target_covered, texels), with_commas(report.target_empty),
                        share_text(report.target_empty, texels), with_commas(report.target_filled));
  }
  text += left_out_text(report);
  for (const TargetReport& target : report.targets) {
    if (target.fit && *target.fit < kLeastFit)
      text += fmt::format("{}: fit {:.2f} of 1\n", visible_line(target.path), *target.fit);
  }
  text += fmt::format("{}, {} threads\n", wall_text(wall_s), report.threads);
  return text;
}

std::string prepared_text(const Report& report, double wall_s) {
  return fmt::format("the cache has {} tiles of the source and {} of targets\n{}, {} threads\n",
                     with_commas(report.source_tiles), with_commas(report.target_tiles),
                     wall_text(wall_s), report.threads);
}

std::string details_text(const Report& report) {
  std::string text = fmt::format("\n{:<14} {:>9} {:>9}\n", "stage", "wall s", "cpu s");
  double wall_s = 0;
  double cpu_s = 0;
  for (const StageTime& stage : report.stages) {
    text += fmt::format("{:<14} {:>9.3f} {:>9.3f}{}\n", stage.name, stage.wall_s, stage.cpu_s,
                        stage.cached ? "  cached" : "");
    wall_s += stage.wall_s;
    cpu_s += stage.cpu_s;
  }
  text += fmt::format("{:<14} {:>9.3f} {:>9.3f}\n\n", "sum", wall_s, cpu_s);
  text += fmt::format("memory   budget {}, leased at most {}, resident at most {}\n",
                      bytes_text(report.memory_budget_bytes), bytes_text(report.leased_peak_bytes),
                      bytes_text(report.peak_rss_bytes));
  text += fmt::format("tiles    source {}, target {}, read {}, written {}\n",
                      with_commas(report.source_tiles), with_commas(report.target_tiles),
                      with_commas(report.tiles_read), with_commas(report.tiles_written));
  text += fmt::format(
      "disk     read {}, written {}, scratch at most {}; stores: source {}, target {}\n",
      bytes_text(report.bytes_read), bytes_text(report.bytes_written),
      bytes_text(report.temp_peak_bytes), bytes_text(report.source_store_bytes),
      bytes_text(report.target_store_bytes));
  text += fmt::format("source   {} Gaussians from {} images\n",
                      with_commas(report.source_gaussians), report.images_decoded);
  for (const auto& [reason, count] : report.source_filtered) {
    text += fmt::format("         {} left out: {}\n", with_commas(count), reason);
  }
  if (report.target_overlapping > 0) {
    text += fmt::format("target   {} texels covered by more than one triangle\n",
                        with_commas(report.target_overlapping));
  }
  for (const NodeReport& node : report.nodes) {
    const std::string bytes = node.bytes > 0 ? ", " + bytes_text(node.bytes) : "";
    const std::string stalls = node.stalls > 0
                                   ? fmt::format(", {} waited {:.2f} s for memory",
                                                 with_commas(node.stalls), node.stalled_s)
                                   : "";
    text +=
        fmt::format("node     {:<6} {:>9} runs {:8.2f} s busy, {} waiting at most{}{}\n", node.name,
                    with_commas(node.runs), node.busy_s, node.most_waiting, stalls, bytes);
  }
  text += fmt::format("kernels  {}\n", report.isa);
  return text;
}

std::string plan_text(const Report& report) {
  std::string text = fmt::format("least memory  {} ({} bytes)\n",
                                 bytes_text(report.least_memory_bytes), report.least_memory_bytes);
  text += fmt::format("needed for    {}\n", visible_line(report.least_memory_for));
  const std::uint64_t process = report.least_memory_bytes + report.memory_beside_bytes;
  text += fmt::format("process       {} ({} bytes) at least: {} of --memory and {} in addition\n",
                      bytes_text(process), process, bytes_text(report.least_memory_bytes),
                      bytes_text(report.memory_beside_bytes));
  text += fmt::format("budget        {}\n", bytes_text(report.memory_budget_bytes));
  text += fmt::format("threads       {}\n", report.threads);
  if (!report.filter.empty()) text += fmt::format("filter        {}\n", report.filter);
  const auto add = [&text](const char* name, std::uint64_t bytes) {
    if (bytes > 0) text += fmt::format("{:<13} at most {}\n", name, bytes_text(bytes));
  };
  const DiskForecast disk = report.disk_most.value_or(DiskForecast{});
  add("scratch disk", disk.scratch_bytes);
  if (disk.scratch_limit_bytes > 0)
    text += fmt::format("scratch limit {}\n", bytes_text(disk.scratch_limit_bytes));
  add("cache", disk.cache_bytes);
  add("outputs", disk.output_bytes);
  for (const std::string& path : report.kept)
    text += fmt::format("would skip    {}\n", visible_line(path));
  for (const std::string& path : report.outputs)
    text += fmt::format("would write   {}\n", visible_line(path));
  for (const HalfDoneImage& image : report.half_done) {
    const double share = static_cast<double>(image.texels) /
                         static_cast<double>(std::max<std::uint64_t>(image.of_texels, 1));
    text += fmt::format("half done     {}: {:.0f} % ({} blocks, {:.0f} s), about {:.0f} s left\n",
                        visible_line(image.path), 100 * share, with_commas(image.blocks),
                        image.worked_s, image.left_s);
  }
  return text;
}

std::string warnings_text(const Report& report) {
  std::string text;
  for (const std::string& warning : report.warnings) {
    text += fmt::format("pounce: warning: {}\n", visible_line(warning));
  }
  for (const std::string& note : report.notes)
    text += fmt::format("pounce: note: {}\n", visible_line(note));
  return text;
}

std::string warnings_json(const Report& report) {
  using Json = nlohmann::ordered_json;
  std::string text;
  for (const std::string& warning : report.warnings) {
    text += Json{{"warning", warning}}.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  }
  for (const std::string& note : report.notes)
    text += Json{{"note", note}}.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  return text;
}

std::string end_line(const Report& report, int status) {
  nlohmann::ordered_json line;
  const bool cancelled =
      status == exit_status(ErrorKind::cancelled) || (report.failure && status == kTerminated);
  line["end"] = !report.failure ? "done" : cancelled ? "cancelled" : "failed";
  line["exit_status"] = status;
  if (report.failure) {
    line["kind"] = report.failure->kind;
    line["message"] = report.failure->message;
  }
  return line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string too_little_text(const Report& report) {
  std::string text;
  for (const TargetReport& target : report.targets) {
    if (target.enough) continue;
    const auto [channel, counts] = least_covered(target);
    text += fmt::format("pounce: {}: {} of {} texels{} covered{}, less than --min-coverage\n",
                        visible_line(target.path), with_commas(counts.covered),
                        with_commas(counts.texels), channel.empty() ? "" : " of " + channel,
                        share_text(counts.covered, counts.texels));
  }
  return text;
}

}  // namespace pounce::cli
