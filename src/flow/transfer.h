// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "job/job_context.h"
#include "job/test_knobs.h"
#include "pounce/options.h"
#include "pounce/progress.h"
#include "pounce/report.h"

namespace pounce::flow {

/// pounce::transfer() and pounce::plan(), with knobs.
Report transfer(const TransferOptions& options, const job::TestKnobs& knobs,
                Progress* progress = nullptr, Report* so_far = nullptr);
/// A transfer as a part of a job, whose stores it shares.
void transfer_in(job::JobContext& job, const TransferOptions& options,
                 const job::TestKnobs& knobs = {});
PlanReport plan(const TransferOptions& options, const job::TestKnobs& knobs,
                Progress* progress = nullptr, Report* so_far = nullptr);

}  // namespace pounce::flow
