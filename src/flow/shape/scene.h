// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "flow/shape/surface.h"
#include "job/job_context.h"
#include "pounce/options.h"

namespace pounce::flow {

/// The surface that a splat scene or a point cloud shows from all around, smoothed, without small
/// parts (docs/stages/8-proxy.md). Its store stays in the job's. Takes the progress to `end`.
/// Throws before any work: Error(budget), and Error(usage) where the output is one of its files.
/// Error(input) where nothing is seen.
SourceSurface surface_of_scene(job::JobContext& job, const TransferOptions& options,
                               const MeshShape& shape, double end);

}  // namespace pounce::flow
