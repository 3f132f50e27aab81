// SPDX-License-Identifier: Apache-2.0
#include "terms.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>

#include "job.h"
#include "pounce/error.h"

namespace pounce::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMiB = 1 << 20;
/// What a task gets as its budget where nobody says: more is not faster for most.
constexpr std::uint64_t kUsualBudget = std::uint64_t{1} << 30;
/// Between what a process is known to take and what the scheduler kills at.
constexpr std::uint64_t kMargin = 64 * kMiB;
/// A task should take some minutes: starting one costs a scheduler 0.2 s and more.
constexpr double kTaskSeconds = 300;
constexpr std::uint32_t kMostOwnTasks = 1000;

}  // namespace

void save(const Terms& terms, const JobFolder& folder) {
  Json json{{"budget_bytes", terms.budget_bytes},
            {"memory_bytes", terms.memory_bytes},
            {"threads", terms.threads},
            {"minutes", terms.minutes},
            {"arrays", terms.arrays},
            {"assemble", terms.assemble}};
  json["more_memory"] = Json::object();
  for (const auto& [task, bytes] : terms.more_memory)
    json["more_memory"][std::to_string(task)] = bytes;
  folder.write("terms.json", json.dump(2) + "\n");
}

std::optional<Terms> load_terms(const JobFolder& folder) {
  const auto text = folder.read("terms.json");
  if (!text) return std::nullopt;
  try {
    const Json json = Json::parse(*text);
    Terms terms{json.at("budget_bytes"),
                json.at("memory_bytes"),
                json.at("threads"),
                json.at("minutes"),
                {},
                json.at("arrays"),
                json.at("assemble")};
    for (const auto& [task, bytes] : json.at("more_memory").items())
      terms.more_memory[static_cast<std::uint32_t>(std::stoul(task))] = bytes;
    return terms;
  } catch (const std::exception&) {
    throw Error(ErrorKind::input,
                folder.path() + "/terms.json: cannot be read; remove it, and submit again");
  }
}

Terms terms_of(const Resources& resources, std::uint64_t memory_bytes, const Report& plan) {
  Terms terms;
  terms.threads = resources.threads == 0 ? 1 : resources.threads;
  const std::uint64_t beside = plan.memory_beside_bytes + kMargin;
  const std::uint64_t asked = resources.memory_bytes;
  terms.budget_bytes = asked != 0 ? asked : std::max(kUsualBudget, plan.least_memory_bytes);
  if (memory_bytes > 0 && asked == 0)
    terms.budget_bytes = memory_bytes > beside ? memory_bytes - beside : 1;
  terms.memory_bytes = memory_bytes > 0 ? memory_bytes : terms.budget_bytes + beside;
  if (terms.budget_bytes < plan.least_memory_bytes ||
      terms.memory_bytes < plan.least_memory_bytes + beside) {
    throw Error(ErrorKind::budget,
                fmt::format("a task needs --mem {} at least: {} of --memory for {}, and {} in "
                            "addition",
                            bytes_text(plan.least_memory_bytes + beside),
                            bytes_text(plan.least_memory_bytes), plan.least_memory_for,
                            bytes_text(beside)));
  }
  return terms;
}

namespace {

double work_seconds(const Report& plan, unsigned threads) { return plan.work_s / threads; }

}  // namespace

std::uint32_t usual_tasks(const Report& plan, unsigned threads) {
  const double tasks = std::ceil(work_seconds(plan, threads) / kTaskSeconds);
  return static_cast<std::uint32_t>(std::clamp(tasks, 1.0, double{kMostOwnTasks}));
}

double usual_minutes(const Report& plan, unsigned threads, std::uint32_t tasks) {
  return 10 + std::ceil(5 * work_seconds(plan, threads) / tasks / 60);
}

}  // namespace pounce::cli
