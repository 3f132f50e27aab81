// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "mesh/mesh.h"

namespace pounce::io {

/// Reads a .glb, .gltf or .obj (by content, then by ending). Throws Error(input) naming the file,
/// the place in it and what to do; Error(storage) where the file cannot be read at all. Never
/// decodes an image. With `texture_uv_set` every texture lies on that UV set, whatever the
/// materials say.
mesh::Mesh read_mesh(const std::string& path, std::optional<std::uint32_t> texture_uv_set = {});

/// An upper bound on the memory that read_mesh() needs for this file at its peak, and the part of
/// it that the returned Mesh keeps, judged from file sizes and headers alone.
struct MeshCost {
  std::uint64_t peak_bytes = 0;
  std::uint64_t kept_bytes = 0;
};
MeshCost mesh_cost(const std::string& path);

/// Is this read as glTF? Throws as read_mesh() does for what is no mesh file.
bool is_gltf(const std::string& path);

}  // namespace pounce::io
