// SPDX-License-Identifier: Apache-2.0
//
// Layers of a surface that face alike and lie close together: a shirt on a body, two sides of a
// collar. A target whose own triangles stray farther from the source's than the layers lie apart
// finds now the one and now the other.
#pragma once

#include <span>
#include <vector>

#include "mesh/mesh.h"
#include "surface/strewn_places.h"

namespace pounce::surface {

/// For each place on a mesh the distance along its normal, either way, of the nearest other part of
/// the mesh that faces like it (the cosine of their normals is at least `least_cosine`); infinite
/// where none is within `most`. What lies within a millionth of `most` is the place's own:
/// triangles that meet there, or coincide. The same for the same mesh; no threads.
std::vector<float> layer_gaps(const mesh::Mesh& mesh, std::span<const Place> places,
                              float least_cosine, float most);

}  // namespace pounce::surface
