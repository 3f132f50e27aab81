// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "io/read_mesh.h"

namespace pounce::io {

/// read_mesh() and mesh_cost() for .gltf and .glb files.
mesh::Mesh read_gltf(const std::string& path, std::optional<std::uint32_t> texture_uv_set);
MeshCost gltf_cost(const std::string& path);

}  // namespace pounce::io
