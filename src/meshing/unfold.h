// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "meshing/surface.h"

namespace pounce::meshing {

/// Moves vertices along the surface where simplifying has left folds: triangles whose facing and
/// that of what is around them have a cosine below `least`. Vertices on a border stay.
void unfold(Surface& surface, double least);

}  // namespace pounce::meshing
