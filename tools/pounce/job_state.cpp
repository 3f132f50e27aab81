// SPDX-License-Identifier: Apache-2.0
//
// `pounce status`: how a job stands that tasks share.
#include "job_state.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "pounce/error.h"
#include "terminal.h"

namespace pounce::cli {
namespace {

constexpr const char* kGroup = "Reporting";
constexpr std::size_t kMostListed = 20;
constexpr int kKilled = 137;

double seconds_of(const TaskState& task) { return task.seen_s - task.begun_s; }

std::optional<double> time_left(const JobState& state) {
  double done_s = 0, left_s = 0;
  std::size_t done = 0, running = 0, open = 0;
  for (const TaskState& task : state.tasks) {
    if (task.state == "done") {
      ++done;
      done_s += seconds_of(task);
    } else if (task.state == "running" && task.fraction > 0) {
      ++running;
      left_s += seconds_of(task) * (1 - task.fraction) / task.fraction;
    } else {
      ++open;
    }
  }
  if (open + running == 0) return 0;
  if (running == 0 || (open > 0 && done == 0)) return std::nullopt;
  if (open > 0) left_s += static_cast<double>(open) * done_s / static_cast<double>(done);
  return left_s / static_cast<double>(running);
}

std::string time_text(double seconds) {
  if (seconds < 120) return fmt::format("{:.0f} s", seconds);
  if (seconds < 7200) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

std::string task_line(const TaskState& task) {
  std::string line = fmt::format("  {:<9} {:<8}", task.name, task.state);
  if (task.state == "missing") return line + "\n";
  line += fmt::format(" {:<12} ", visible_line(task.host));
  if (task.state == "running") {
    line += fmt::format("{:.0f} %, {} since {}", 100 * task.fraction, visible_line(task.stage),
                        time_text(seconds_now() - task.begun_s));
  } else if (task.state == "done") {
    line += fmt::format("in {}, {} resident", time_text(seconds_of(task)),
                        bytes_text(task.resident_bytes));
  } else {
    if (task.exit_status != 0) line += fmt::format("status {}: ", task.exit_status);
    line += visible_line(task.message);
  }
  if (!task.scheduler.empty()) line += fmt::format(" ({})", visible_line(task.scheduler));
  return line + "\n";
}

std::string state_text(const JobFolder& folder, const JobState& state) {
  std::string counts;
  for (const char* name : {"done", "running", "stopped", "failed", "lost", "missing"}) {
    if (const std::size_t count = state.count(name); count > 0)
      counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", count, name);
  }
  std::string text =
      fmt::format("{}: {} tasks: {}\n", visible_line(folder.path()), state.tasks.size(), counts);
  text += task_line(state.prepare);
  std::size_t listed = 0, left = 0;
  for (const TaskState& task : state.tasks) {
    if (task.state == "done" || task.state == "missing") continue;
    if (listed++ < kMostListed) {
      text += task_line(task);
    } else {
      ++left;
    }
  }
  if (left > 0) text += fmt::format("  and {} more; --json lists all\n", left);
  text += task_line(state.assemble);
  if (state.left_s && *state.left_s > 0)
    text +=
        fmt::format("about {} left with as many tasks at once as now\n", time_text(*state.left_s));
  return text;
}

nlohmann::ordered_json json_of(const TaskState& task) {
  nlohmann::ordered_json json{{"task", task.name}, {"state", task.state}};
  if (task.state == "missing") return json;
  json["host"] = task.host;
  json["scheduler"] = task.scheduler;
  json["begun"] = task.begun_s;
  json["seen"] = task.seen_s;
  json["fraction"] = task.fraction;
  json["stage"] = task.stage;
  json["peak_rss_bytes"] = task.resident_bytes;
  json["cpu_s"] = task.cpu_s;
  json["texels"] = task.texels;
  json["covered"] = task.covered;
  json["outputs"] = task.outputs;
  json["exit_status"] = task.exit_status;
  json["message"] = task.message;
  return json;
}

std::string state_json(const JobFolder& folder, const JobState& state) {
  nlohmann::ordered_json json{{"folder", folder.path()}, {"prepare", json_of(state.prepare)}};
  json["tasks"] = nlohmann::ordered_json::array();
  for (const TaskState& task : state.tasks) json["tasks"].push_back(json_of(task));
  json["assemble"] = json_of(state.assemble);
  json["left_s"] = state.left_s ? nlohmann::ordered_json(*state.left_s) : nullptr;
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace

std::size_t JobState::count(const std::string& state) const {
  return static_cast<std::size_t>(std::count_if(
      tasks.begin(), tasks.end(), [&](const TaskState& task) { return task.state == state; }));
}

JobState read_state(const JobFolder& folder) {
  JobState state;
  const std::uint32_t tasks = folder.tasks();
  state.prepare = folder.look_at("prepare");
  state.assemble = folder.look_at("assemble");
  for (std::uint32_t task = 1; task <= tasks; ++task)
    state.tasks.push_back(folder.look_at(std::to_string(task)));
  state.left_s = time_left(state);
  return state;
}

bool died_of_memory(const TaskState& state, std::uint64_t given_bytes) {
  if (state.state == "failed")
    return state.exit_status == exit_status(ErrorKind::budget) || state.exit_status == kKilled;
  // Some schedulers kill without a word; who was close to the limit was probably above it.
  return state.state == "lost" && given_bytes > 0 &&
         state.resident_bytes > given_bytes - given_bytes / 4;
}

Command add_status_command(CLI::App& program) {
  struct Line {
    std::string folder;
    bool json = false;
  };
  const auto line = std::make_shared<Line>();
  CLI::App* command =
      program.add_subcommand("status", "Show how a job stands that tasks share, from its folder");
  set_help_text(
      *command,
      "Usage: pounce status FOLDER [--json]\n"
      "\n"
      "Says which tasks are done, running (where, since when), failed (why) or missing. "
      "It reads files\nalone, and asks no scheduler: a task that has said nothing for two "
      "minutes is lost.");
  command->add_option("FOLDER", line->folder, "Job folder that the tasks share")
      ->option_text(" ")
      ->required();
  add_switch(*command, "--json", kGroup, "Print JSON instead of text; times in seconds since 1970",
             line->json);
  return {command, [line] {
            const JobFolder folder(line->folder);
            const JobState state = read_state(folder);
            write_stdout(line->json ? state_json(folder, state) : state_text(folder, state));
            return 0;
          }};
}

}  // namespace pounce::cli
