// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pounce/error.h"
#include "pounce/export.h"
#include "pounce/options.h"
#include "pounce/progress.h"
#include "pounce/report.h"

namespace pounce {

/// Makes a textured model of a splat scene, a point cloud or a heavy mesh: a mesh with UVs as
/// proxy() makes it, and a transfer of the source onto it as transfer() does it, with one budget
/// and stores that both share. Of a mesh every channel is transferred, and its shape goes into the
/// normal map.
///
/// Same input, same output bytes, at any budget, thread count and cache state: those of proxy() and
/// transfer() one after the other.
///
/// Blocks until done. Throws pounce::Error; then no file is left. `progress` may be null; it must
/// outlive the call. `so_far` as in transfer().
POUNCE_API Report textured_mesh(const TexturedMeshOptions& options, Progress* progress = nullptr,
                                Report* so_far = nullptr);

}  // namespace pounce
