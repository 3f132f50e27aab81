// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "mesh/mesh.h"

namespace pounce::mesh {

/// Triangles whose corners lie, in the same order around, exactly where those of one before them in
/// the file do, with other UVs or another material: nothing of them is ever seen. Needs 16 bytes
/// for each of an eighth of the triangles.
std::uint64_t count_coincident(const Mesh& mesh);

}  // namespace pounce::mesh
