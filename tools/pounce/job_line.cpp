// SPDX-License-Identifier: Apache-2.0
#include "job_line.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "pounce/error.h"
#include "task_number.h"

namespace pounce::cli {

const OptionReport* find_given(const std::vector<OptionReport>& given, const std::string& name) {
  const auto at = std::find_if(given.begin(), given.end(),
                               [&](const OptionReport& option) { return option.name == name; });
  return at == given.end() ? nullptr : &*at;
}

namespace {

/// Is the option, or one that excludes it, on the command line?
bool is_overridden(const std::vector<OptionInfo>& table, const std::vector<OptionReport>& given,
                   const std::string& name) {
  if (find_given(given, name) != nullptr) return true;
  return std::any_of(table.begin(), table.end(), [&](const OptionInfo& info) {
    const std::string other = info.name == name       ? info.excludes
                              : info.excludes == name ? info.name
                                                      : "";
    return !other.empty() && find_given(given, other) != nullptr;
  });
}

/// The texts of an option in a file, each as the command line would have it.
std::vector<std::string> typed_texts(const std::vector<OptionInfo>& table,
                                     const OptionReport& option) {
  const auto row = std::find_if(table.begin(), table.end(),
                                [&](const OptionInfo& info) { return info.name == option.name; });
  if (row == table.end() || row->values != OptionValues::list) return option.values;
  return {fmt::format("{}", fmt::join(option.values, ","))};
}

template <class Options>
void set_recorded(JobCommand command, Line<Options>& line) {
  const std::string name = job_command_name(command);
  const RecordedJob job = read_job(line.job_path);
  if (job.command != name) {
    throw Error(ErrorKind::usage,
                fmt::format("{0}: is a job of {1}; run it with pounce {1} --job {0}", line.job_path,
                            job.command));
  }
  const std::vector<OptionInfo>& table = option_table(command);
  for (const OptionReport& option : job.options) {
    if (is_overridden(table, line.given, option.name)) continue;
    if (option.name == "plan") {
      line.job.plan_only = true;
      continue;
    }
    try {
      for (const std::string& text : typed_texts(table, option))
        set_option(line.options, option.name, text);
    } catch (const Error& error) {
      throw Error(error.kind(), line.job_path + ": " + error.what());
    }
  }
}

}  // namespace

template <class Options>
void set_options(JobCommand command, Line<Options>& line) {
  if (JobFolder folder(line.job_path); !line.job_path.empty() && folder.has_job()) {
    line.farm.folder = line.job_path;
    line.job_path = folder.job_path();
  }
  if (!line.job_path.empty()) set_recorded(command, line);
  for (const OptionReport& option : line.given) {
    for (const std::string& text : option.values) set_option(line.options, option.name, text);
  }
  const std::vector<OptionReport> known = option_texts(line.options);
  for (const OptionInfo& info : option_table(command)) {
    if (!info.is_required || find_given(known, info.name) != nullptr) continue;
    throw Error(ErrorKind::usage,
                (info.is_operand ? info.value : "--" + info.name) + " is required");
  }
}

template void set_options(JobCommand, Line<TransferOptions>&);
template void set_options(JobCommand, Line<MapsOptions>&);
template void set_options(JobCommand, Line<GaussiansOptions>&);
template void set_options(JobCommand, Line<ProxyOptions>&);
template void set_options(JobCommand, Line<TexturedMeshOptions>&);

/// Which share of the job the line asks for; a job folder is made, or checked.
void take_share(Line<TransferOptions>& line) {
  FarmLine& farm = line.farm;
  if (!farm.task.empty()) farm.role = TaskRole::share;
  if (farm.role == TaskRole::whole) {
    if (farm.folder.empty() || line.job_path == JobFolder(farm.folder).job_path()) return;
    throw Error(ErrorKind::usage, "--job-folder: is shared by tasks; say which one with --task");
  }
  TaskNumber number{1, farm.tasks};
  if (farm.role == TaskRole::share) number = parse_task("--task", farm.task);
  const JobFolder folder(farm.folder);
  if (number.tasks == 0 && !farm.folder.empty() && folder.has_job()) number.tasks = folder.tasks();
  if (number.tasks == 0 && farm.role == TaskRole::prepare && farm.folder.empty()) number.tasks = 1;
  if (number.tasks == 0) {
    throw Error(ErrorKind::usage,
                farm.role == TaskRole::prepare
                    ? "--tasks N: say how many tasks will share this job"
                    : fmt::format("--task {0}: say of how many, as in {0}/20", farm.task));
  }
  line.job.prepares = farm.role == TaskRole::prepare;
  line.options.share = {farm.role, number.task, number.tasks, farm.folder};
  const std::string name = farm.role == TaskRole::prepare ? "prepare" : std::to_string(number.task);
  line.job.who = fmt::format("host {}, {}", host_name(),
                             farm.role == TaskRole::prepare
                                 ? name
                                 : fmt::format("task {} of {}", number.task, number.tasks));
  if (farm.folder.empty() || line.job.plan_only) return;
  folder.be_for(job_command_name(JobCommand::transfer), option_texts(line.options), number.tasks);
  line.job.log = std::make_shared<TaskLog>(folder, name);
}

}  // namespace pounce::cli
