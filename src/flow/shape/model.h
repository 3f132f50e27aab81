// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "flow/shape/surface.h"
#include "job/job_context.h"
#include "pounce/options.h"

namespace pounce::flow {

/// The surface of a mesh as one: what its file has several times because of seams, hard edges or
/// materials is one vertex here. Takes the progress to `end`. Throws Error(budget) before it is
/// read where that is hopeless, Error(usage) where the output is one of its files.
SourceSurface surface_of_model(job::JobContext& job, const TransferOptions& options,
                               const MeshShape& shape, double end);

}  // namespace pounce::flow
