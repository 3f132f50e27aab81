// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/axes.h"
#include "mesh/mesh.h"

namespace pounce::mesh {

/// Turns a mesh: positions, normals and tangents. Axes that mirror also change the winding of the
/// triangles and the handedness of the tangents, so that normals still face outwards and textures
/// still read the same way. Exact.
void orient(Mesh& mesh, const Axes& axes);

}  // namespace pounce::mesh
