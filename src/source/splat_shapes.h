// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "store/blocks/splat_block.h"

namespace pounce::source {

/// How round the Gaussians of a scene are: the median of their second largest standard deviation
/// over their largest. 1 for none.
float median_roundness(std::span<const store::Splat> splats);

/// How large the Gaussians of a scene are: the median of their largest standard deviations. 0 for
/// none.
float median_size(std::span<const store::Splat> splats);

/// The longest edge of a texel that is fine beside Gaussians of that median size
/// (docs/decisions/035-coarse-splats.md).
float fine_edge(float size);

/// Are a scene's Gaussians the discs of a surface (1), or needles and tilted ellipsoids that make a
/// picture together (0)? By their roundness: trained captures have 0.24 to 0.33, made scenes 0.78
/// to 0.83 (docs/decisions/023-splat-blend.md).
float discness(float roundness);

}  // namespace pounce::source
