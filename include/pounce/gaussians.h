// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pounce/error.h"
#include "pounce/export.h"
#include "pounce/options.h"
#include "pounce/progress.h"
#include "pounce/report.h"

namespace pounce {

/// Writes Gaussians as 3DGS PLY, SPZ 2 or glTF (KHR_gaussian_splatting), by the output's ending. Of
/// a textured mesh: one flat disc per texel of the baseColor image that the surface uses, one per
/// triangle that holds no texel's centre or has no image. Of a splat scene: its own, harmonics
/// included, less what the options leave out, in its order.
///
/// Out of core: never holds more than options.resources.memory_bytes of big data. Same input, same
/// output bytes, at any budget, thread count and cache state. The file appears whole or not at all.
///
/// Blocks until done. Throws pounce::Error. `progress` may be null; it must outlive the call.
/// `so_far` as in transfer().
POUNCE_API Report gaussians(const GaussiansOptions& options, Progress* progress = nullptr,
                            Report* so_far = nullptr);

}  // namespace pounce
