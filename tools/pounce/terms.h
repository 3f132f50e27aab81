// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "job_folder.h"
#include "pounce/options.h"
#include "pounce/report.h"

namespace pounce::cli {

/// How the tasks of a job are to run; kept in the folder for whoever submits again.
struct Terms {
  std::uint64_t budget_bytes = 0, memory_bytes = 0;
  unsigned threads = 1;
  double minutes = 0;
  std::map<std::uint32_t, std::uint64_t> more_memory;  ///< by task: one that died of too little
  std::vector<std::string> arrays;                     ///< of Slurm, that may still be at work
  std::string assemble;                                ///< the same
};
void save(const Terms& terms, const JobFolder& folder);
/// Nothing of a job that was never submitted. Throws Error(input), Error(storage).
std::optional<Terms> load_terms(const JobFolder& folder);

/// From what planning says, and from the line: `memory_bytes` of a task, 0: not said. Throws
/// Error(budget) where that is too little.
Terms terms_of(const Resources& resources, std::uint64_t memory_bytes, const Report& plan);
/// Tasks of some minutes each.
std::uint32_t usual_tasks(const Report& plan, unsigned threads);
/// Five times what is expected, and ten minutes for what is not.
double usual_minutes(const Report& plan, unsigned threads, std::uint32_t tasks);

}  // namespace pounce::cli
