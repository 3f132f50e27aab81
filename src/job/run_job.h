// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/system_limits.h"
#include "job/job_context.h"

namespace pounce::job {

/// What the job may lease: as asked for, else half of what the process may use.
std::uint64_t budget_bytes(const Resources& resources);

/// Opens what a job needs: budget, stores (the cache, or scratch), progress. `output` gives the
/// default folder for scratch files; `own_files`, if not null, holds all of them and every store,
/// and there is no cache: for tests. `rebuild` checks every pack of the cache before it is
/// believed: one of them turned out to be damaged.
std::unique_ptr<JobContext> open_job(const Resources& resources, const std::string& output,
                                     FileSystem* own_files, bool rebuild, bool plan_only,
                                     JobRun& run);

/// Runs a job on threads of its own, as many as it asks for; what they are beside does not change.
/// A damaged pack in the cache costs one rebuild from the inputs, with a warning. The report goes
/// to `so_far`, if given, whether the job succeeds or throws.
Report run_job(const Resources& resources, Progress* progress, Report* so_far,
               const std::function<void(JobRun&, bool rebuild)>& job);

/// Throws Error(budget) that names the least memory that works and what asks for it, or the limit
/// of the process that does not hold that. `held_bytes`: what of it is in memory already, as
/// meshes.
void require_least(JobContext& job, const LeastMemory& least, std::uint64_t held_bytes);

/// Before a step of planning, as reading a mesh, that has this need: throws Error(budget) as
/// require_least() does if that is so much more than the budget that it is not worth going on to
/// say exactly what the whole job needs. That may be more than is named here, never less.
void require_early(JobContext& job, const LeastMemory& need, std::uint64_t held_bytes);

// --- what steps need -----------------------------------------------------------------------------

/// What the steps of a job need of memory: the one that needs the most decides. Not thread-safe.
class MemoryNeeds {
 public:
  explicit MemoryNeeds(job::JobContext& job) : job_(job) {}

  /// What stays for the whole job is in use beside every step that is added from now on.
  void keep(std::uint64_t bytes) { kept_bytes_ += bytes; }
  void add(std::uint64_t bytes, const std::string& why) {
    const std::uint64_t with_kept = bytes + kept_bytes_;
    if (with_kept > most_.bytes) most_ = {with_kept, why};
  }
  /// The same of a step of planning, which is about to run: throws Error(budget) where it is
  /// hopeless (job::require_early). `held_bytes`: what of it is in memory already.
  void add_now(std::uint64_t bytes, const std::string& why, std::uint64_t held_bytes) {
    add(bytes, why);
    require_early(job_, most_, held_bytes);
  }
  const job::LeastMemory& most() const { return most_; }

 private:
  job::JobContext& job_;
  std::uint64_t kept_bytes_ = 0;
  job::LeastMemory most_;
};

// --- limits of the process -----------------------------------------------------------------------

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

/// How much may be in use where steps run at once that could run one after the other: the budget,
/// or what limits of the process leave now, where that is less. So nothing that is only quicker
/// ends a job that these limits would let run (or refuse with a sentence).
std::uint64_t bytes_at_once(const JobContext& job);

/// Measures the process, says in the report what it needs, and holds the job's budget to what its
/// limits leave. What it returns is that.
HeldBudget hold_to_limits(JobContext& job, const LeastMemory& least, std::uint64_t held_bytes);

}  // namespace pounce::job
