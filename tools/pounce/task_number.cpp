// SPDX-License-Identifier: Apache-2.0
//
// What schedulers call a task of an array. They count from 0 or from 1; where that is the user's
// choice, the array's lowest number tells. Sources: the documentation of each, see docs/farm.md.
#include "task_number.h"

#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <optional>
#include <vector>

#include "pounce/error.h"
#include "pounce/options.h"

namespace pounce::cli {
namespace {

struct Scheduler {
  const char* index;   ///< variable
  std::int64_t base;   ///< of the first task, where nothing says it
  const char* lowest;  ///< variable with the array's lowest number; null: none
  const char* count;   ///< variable with the number of tasks; null: none
};
constexpr Scheduler kSchedulers[] = {
    {"SLURM_ARRAY_TASK_ID", 0, "SLURM_ARRAY_TASK_MIN", nullptr},
    {"JOB_COMPLETION_INDEX", 0, nullptr, nullptr},
    {"AWS_BATCH_JOB_ARRAY_INDEX", 0, nullptr, "AWS_BATCH_JOB_ARRAY_SIZE"},
    {"SGE_TASK_ID", 1, nullptr, nullptr},
    {"PBS_ARRAY_INDEX", 1, nullptr, nullptr},
};

std::optional<std::int64_t> whole_number(const std::string& text) {
  std::int64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [last, error] = std::from_chars(text.data(), end, value);
  if (text.empty() || error != std::errc() || last != end) return std::nullopt;
  return value;
}

std::optional<std::int64_t> variable(const char* name) {
  const char* text = name == nullptr ? nullptr : std::getenv(name);
  return text == nullptr ? std::nullopt : whole_number(text);  // SGE: "undefined" outside of arrays
}

[[noreturn]] void refuse(const std::string& option, const std::string& text,
                         const std::string& why) {
  throw Error(ErrorKind::usage, fmt::format("{} {}: {}", option, text, why));
}

std::uint32_t checked(const std::string& option, const std::string& text,
                      std::optional<std::int64_t> value, std::int64_t most) {
  if (!value || *value < 1 || *value > most)
    refuse(option, text, fmt::format("expected K/N with 1 <= K <= N <= {}, or auto", kMostTasks));
  return static_cast<std::uint32_t>(*value);
}

TaskNumber from_environment(const std::string& option, const std::string& text,
                            std::uint32_t tasks) {
  std::vector<const Scheduler*> found;
  std::string names;
  for (const Scheduler& scheduler : kSchedulers) {
    if (variable(scheduler.index)) found.push_back(&scheduler);
    names += (names.empty() ? "" : ", ") + std::string(scheduler.index);
  }
  if (found.empty()) refuse(option, text, "no scheduler has set " + names + "; say --task K/N");
  if (found.size() > 1)
    refuse(option, text,
           fmt::format("both {} and {} are set; say --task K/N", found[0]->index, found[1]->index));
  const Scheduler& scheduler = *found.front();
  const std::int64_t lowest = variable(scheduler.lowest).value_or(scheduler.base);
  if (lowest > 1)
    refuse(option, text,
           fmt::format("the array begins at {}, so it is not known which task is the first; say "
                       "--task K/N",
                       lowest));
  const std::int64_t task = *variable(scheduler.index) - lowest + 1;
  if (const auto count = variable(scheduler.count); tasks == 0 && count && *count > 0)
    tasks = checked(option, text, count, kMostTasks);
  if (task < 1 || (tasks > 0 && task > tasks))
    refuse(
        option, text,
        fmt::format("{}={} is no task of {}", scheduler.index, *variable(scheduler.index), tasks));
  return {static_cast<std::uint32_t>(task), tasks};
}

}  // namespace

TaskNumber parse_task(const std::string& option, const std::string& text) {
  const std::size_t slash = text.find('/');
  const std::string first = text.substr(0, slash);
  std::uint32_t tasks = 0;
  if (slash != std::string::npos)
    tasks = checked(option, text, whole_number(text.substr(slash + 1)), kMostTasks);
  if (first == "auto") return from_environment(option, text, tasks);
  const std::uint32_t task =
      checked(option, text, whole_number(first), tasks > 0 ? tasks : kMostTasks);
  if (tasks == 0) refuse(option, text, "expected K/N: which task of how many, or auto");
  return {task, tasks};
}

std::uint32_t parse_count(const std::string& option, const std::string& text) {
  const auto value = whole_number(text);
  if (!value || *value < 1 || *value > kMostTasks)
    refuse(option, text, fmt::format("expected a whole number of 1 to {}", kMostTasks));
  return static_cast<std::uint32_t>(*value);
}

}  // namespace pounce::cli
