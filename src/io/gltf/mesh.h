// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "io/read_mesh.h"

namespace pounce::io {

/// read_mesh() and mesh_cost() for .gltf and .glb files.
mesh::Mesh read_gltf(const std::string& path, const MeshReading& reading);
MeshCost gltf_cost(const std::string& path, const MeshReading& reading, std::uint64_t most_bytes);

}  // namespace pounce::io
