// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "meshing/surface.h"

namespace pounce::meshing {

/// Moves vertices along the surface where simplifying has left folds: triangles that face away from
/// what is around them. Vertices on a border stay.
void unfold(Surface& surface);

}  // namespace pounce::meshing
