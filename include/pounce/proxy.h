// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pounce/error.h"
#include "pounce/export.h"
#include "pounce/options.h"
#include "pounce/progress.h"
#include "pounce/report.h"

namespace pounce {

/// Makes a mesh with UVs of the surface of a splat scene or a point cloud: the target of a transfer
/// of the same scene, whose coordinates it has. The scene is drawn from 48 sides; depths become a
/// signed distance on cubes, its surface is smoothed, simplified, cut into charts and packed.
/// Written as .glb, whole or not at all.
///
/// Same input, same output bytes, at any budget, thread count and cache state.
///
/// Blocks until done. Throws pounce::Error. `progress` may be null; it must outlive the call.
/// `so_far` as in transfer().
POUNCE_API Report proxy(const ProxyOptions& options, Progress* progress = nullptr,
                        Report* so_far = nullptr);

}  // namespace pounce
