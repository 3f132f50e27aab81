// SPDX-License-Identifier: Apache-2.0
//
// What a report says of a job before the job has done anything. It is written first, so that the
// report of any failure shows what was asked for.
#include "planning/describe_job.h"

#include <algorithm>

#include "planning/known_map.h"
#include "pounce/option_table.h"

namespace pounce::planning {

void describe(const TransferOptions& options, bool plan_only, Report& report) {
  const bool is_map = is_hit_map(options.source);  // of whose files its plan knows
  report.command = job_command_name(is_map ? JobCommand::apply : JobCommand::transfer);
  report.method = method_name(options.mesh.method);
  if (!is_map) add_input(options.source, report);
  for (const std::string& target : options.targets) add_input(target, report);
  report.options = option_texts(options);
  if (plan_only) report.options.push_back({"plan", {"true"}, false});
}

void describe(const MapsOptions& options, Report& report) {
  report.command = job_command_name(JobCommand::maps);
  add_input(options.target, report);
  report.options = option_texts(options);
}

void describe(const GaussiansOptions& options, Report& report) {
  report.command = job_command_name(JobCommand::gaussians);
  add_input(options.source, report);
  report.options = option_texts(options);
}

void add_input(const std::string& path, Report& report) {
  std::vector<std::string>& inputs = report.inputs;
  if (!path.empty() && std::find(inputs.begin(), inputs.end(), path) == inputs.end())
    inputs.push_back(path);
}

}  // namespace pounce::planning
