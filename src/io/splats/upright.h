// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "store/blocks/splat_block.h"

namespace pounce::io {

/// Names the axes of an ellipsoid anew, so that its rotation turns as little as possible: of the 24
/// ways the one with the largest w, which is 0.85 or more. The ellipsoid stays what it was.
void turn_least(store::Splat& splat);

}  // namespace pounce::io
