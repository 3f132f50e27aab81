// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>

#include "io/gltf/mesh_writer.h"
#include "job/job_context.h"
#include "pounce/options.h"

namespace pounce::flow {

/// Makes a lighter mesh of a model, with the UVs and materials that it has, and gives it to
/// `write`, which returns the file's size. A material of UDIM tiles becomes one for each tile:
/// "skin.1002". Takes the progress to `end`. Throws what read_heavy() does, and Error(input) where
/// triangles have no UVs.
void write_with_own_uvs(job::JobContext& job, const TransferOptions& options,
                        const MeshShape& shape, double end,
                        const std::function<std::uint64_t(const io::PlainMesh&)>& write);

}  // namespace pounce::flow
