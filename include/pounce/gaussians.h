// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pounce/error.h"
#include "pounce/options.h"
#include "pounce/progress.h"
#include "pounce/report.h"

namespace pounce {

/// Writes the Gaussians of a textured mesh as a 3DGS PLY (binary little endian, columns x y z,
/// nx ny nz, f_dc_0..2, opacity, scale_0..2, rot_0..3): one flat disc per texel of the baseColor
/// image that the surface uses, one per triangle that holds no texel's centre or has no image.
///
/// Out of core: never holds more than options.resources.memory_bytes of big data. Same input, same
/// output bytes, at any budget, thread count and cache state. The file appears whole or not at all.
///
/// Blocks until done. Throws pounce::Error. `progress` may be null; it must outlive the call.
/// `so_far` as in transfer().
Report gaussians(const GaussiansOptions& options, Progress* progress = nullptr,
                 Report* so_far = nullptr);

}  // namespace pounce
