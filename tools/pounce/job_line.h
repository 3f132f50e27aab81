// SPDX-License-Identifier: Apache-2.0
//
// A command line with a job on it. What it gives is kept as text until all of it is read, since
// --job may name a file with more options: those are set first, so that the command line wins.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "commands.h"
#include "pounce/option_table.h"

namespace pounce::cli {

/// What the command line says of tasks that share the job.
struct FarmLine {
  TaskRole role = TaskRole::whole;
  std::string folder;       ///< --job-folder, or --job if that is one
  std::string task;         ///< --task
  std::uint32_t tasks = 0;  ///< --tasks
};

template <class Options>
struct Line {
  Options options;
  JobSettings job;
  FarmLine farm;
  std::string job_path;             ///< --job
  std::vector<OptionReport> given;  ///< on the command line
};

/// What the line gives of the option of this name; null: nothing.
const OptionReport* find_given(const std::vector<OptionReport>& given, const std::string& name);

/// Adds an option or operand of the table.
template <class Options>
void add_given(CLI::App& command, const OptionInfo& info,
               const std::shared_ptr<Line<Options>>& line) {
  CLI::Option* option = add_row(command, info, [line, name = info.name](const auto& text) {
    if (find_given(line->given, name) == nullptr) line->given.push_back({name, {}, false});
    line->given.back().values.push_back(text);
  });
  if (!info.excludes.empty()) option->excludes("--" + info.excludes);
}

/// Once the whole line is read: sets its options, after those of --job. A job folder is both.
template <class Options>
void set_options(JobCommand command, Line<Options>& line);

/// Which share of the job the line asks for; a job folder is made, or checked.
void take_share(Line<TransferOptions>& line);

}  // namespace pounce::cli
