// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

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

}  // namespace pounce::job
