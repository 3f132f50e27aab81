// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/system_limits.h"
#include "job/job_context.h"

namespace pounce::job {

/// What a process with this job takes beside its budget (docs/decisions/045): what it has of memory
/// now that no file holds, less what of that is in the budget, and room for what follows.
std::uint64_t beside_budget(std::uint64_t anonymous_bytes, std::uint64_t held_bytes,
                            unsigned threads);

/// What a job needs of the limits that its process is under.
struct ProcessNeed {
  LeastMemory least;             ///< of the budget
  std::uint64_t held_bytes = 0;  ///< of that, what is in memory already
  std::uint64_t beside_bytes = 0;
  unsigned threads = 1;
};

/// A budget, and what made it less than was asked for; empty where nothing did.
struct HeldBudget {
  std::uint64_t bytes = 0;
  std::string lowered_by;
};

/// The budget of at most `asked_bytes` with which these limits do not end the process. Limits that
/// only refuse memory lower it not: a budget is seldom used up, and a refusal is an error like
/// others. Throws Error(budget) that names the limit, the need and the cure where the least cannot
/// be had.
HeldBudget budget_under(const std::vector<MemoryLimit>& limits, std::uint64_t asked_bytes,
                        const ProcessNeed& need);

/// Measures the process, says in the report what it needs, and holds the job's budget to what its
/// limits leave. What it returns is that.
HeldBudget hold_to_limits(JobContext& job, const LeastMemory& least, std::uint64_t held_bytes);

}  // namespace pounce::job
