// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "flow/shape/surface.h"
#include "job/job_context.h"
#include "planning/load_mesh.h"
#include "pounce/options.h"
#include "runtime/memory_budget.h"

namespace pounce::flow {

/// A mesh that a lighter one is made of, and room in the budget for it and for what is made of it.
struct HeavyModel {
  planning::PlacedMesh placed;
  std::vector<bool> tiled;  ///< by material: is some texture of it a set of UDIM tiles?
  runtime::Lease held, room;
};
/// Throws Error(budget) before it is read where that is hopeless, Error(usage) where the output is
/// one of its files, and what planning its transfer refuses of it.
HeavyModel read_heavy(job::JobContext& job, const TransferOptions& options, const MeshShape& shape);

/// A material but for its images.
io::PlainLook look_of(const mesh::Material& material);

/// The surface of a mesh as one: what its file has several times because of seams, hard edges or
/// materials is one vertex here. Takes the progress to `end`. Throws what read_heavy() does.
SourceSurface surface_of_model(job::JobContext& job, const TransferOptions& options,
                               const MeshShape& shape, double end);

}  // namespace pounce::flow
