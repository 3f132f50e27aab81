// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "io/read_mesh.h"

namespace pounce::io {

/// read_mesh() and mesh_cost() for .obj files.
mesh::Mesh read_obj(const std::string& path, const MeshReading& reading);
MeshCost obj_cost(const std::string& path, const MeshReading& reading);

}  // namespace pounce::io
