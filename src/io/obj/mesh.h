// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "io/read_mesh.h"

namespace pounce::io {

/// read_mesh() for .obj files.
mesh::Mesh read_obj(const std::string& path, const MeshReading& reading);

}  // namespace pounce::io
