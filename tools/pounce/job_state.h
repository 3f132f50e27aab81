// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "job_folder.h"

namespace pounce::cli {

/// How a whole job stands, from the files of its folder alone.
struct JobState {
  TaskState prepare, assemble;
  std::vector<TaskState> tasks;  ///< 1 to N
  std::optional<double> left_s;  ///< with as many tasks at once as now; nothing: nobody knows
  std::size_t count(const std::string& state) const;
};
JobState read_state(const JobFolder& folder);

/// Did it end for want of memory, or probably?
bool died_of_memory(const TaskState& state, std::uint64_t given_bytes);

}  // namespace pounce::cli
