// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "flow/sources/source.h"
#include "flow/transfer_plan.h"
#include "job/job_context.h"

namespace pounce::flow {

/// What a job with --skip-existing does about outputs that another one is just making.
enum class OthersWork : std::uint8_t {
  leave,  ///< nothing, where there is nothing else to do
  await,  ///< it waits until they are there, or that job is no more
};

/// Makes one target: page after page it is vectorized, projected and written, then the model, if
/// that is the output. What was found goes to the job's report. The target's mesh goes as soon as
/// its last page is vectorized. False, and nothing done: others are making all of it that is
/// missing.
bool transfer_to(job::JobContext& job, const planning::OutputPolicy& policy, const Source& source,
                 PlannedTarget& target, ProgressRange range, OthersWork others);

}  // namespace pounce::flow
