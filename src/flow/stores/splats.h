// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "job/job_context.h"
#include "planning/plan.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// `poll`: as io::open_splat_scene(), which takes io::kOpenSplatBytes.
planning::SceneFacts scene_facts(
    const planning::SplatRequest& request, const std::function<void()>& poll = [] {});

/// Reads, filters and sorts a scene into a store of blocks, or finds the store in the cache. Takes
/// job.meter through a stage "precondition" whose end is `progress_end`. Adds what was left out to
/// job.report.source_filtered, also where the store was cached. Throws Error(input) where the file
/// is none that we read or no Gaussian of it is of use, Error(budget) below
/// planning::SceneFacts::least_bytes.
std::unique_ptr<store::SplatStore> splat_store(job::JobContext& job,
                                               const planning::SplatRequest& request, bool* cached,
                                               double progress_end);

}  // namespace pounce::flow
