// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>

#include "flow/shape/surface.h"
#include "io/gltf/mesh_writer.h"
#include "job/job_context.h"
#include "pounce/options.h"

namespace pounce::flow {

/// Makes a mesh with UVs of a surface, which is used up: simplified, cut into charts, packed; and
/// gives it to `write`, which returns the file's size. Throws Error(usage) where the charts have no
/// room.
void write_shape(job::JobContext& job, SourceSurface surface, const MeshShape& shape, double end,
                 const std::function<std::uint64_t(const io::PlainMesh&)>& write);

}  // namespace pounce::flow
