// SPDX-License-Identifier: Apache-2.0
//
// What earlier runs of a job have left of its target: images that are half done.
#pragma once

#include <cstddef>
#include <vector>

#include "core/hash.h"
#include "job/job_context.h"
#include "planning/plan.h"
#include "pounce/report.h"

namespace pounce::planning {

/// Of all that decides what a page's results are: the jobs of its images say that, and more; how
/// they are stored the image below them may decide, which is no part of the job in place.
Hash128 results_key(const SourcePlan& source, const PassPlan& pass, const TargetPlan& target,
                    std::size_t page);

/// Is anything of this page in these channels to be made?
bool has_work(const TargetPlan& target, const std::vector<std::size_t>& channels, std::size_t page);

/// The images of a target, whose jobs are named, that an earlier run has begun.
std::vector<HalfDoneImage> half_done(job::JobContext& job, const SourcePlan& source,
                                     const TargetPlan& target);
/// A run that died after its last image, or between two of them, left what nobody goes on with:
/// results, and files beside images that are there.
void remove_what_is_done(job::JobContext& job, const SourcePlan& source, const TargetPlan& target);

}  // namespace pounce::planning
