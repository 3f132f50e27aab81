// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/vec.h"
#include "mesh/mesh.h"

namespace pounce::io {

/// How a mesh file is read.
struct MeshReading {
  bool allow_external = false;  ///< also files outside of the mesh's folder that it names
  /// Every texture lies on that UV set, whatever the materials say.
  std::optional<std::uint32_t> texture_uv_set;
  bool vertex_colours = false;  ///< fill Mesh::colours
  bool needs_materials = true;  ///< false: that an OBJ's material files are missing is not said
  Vec3d origin = {};            ///< is subtracted from all positions, in double precision
};

/// Reads a .glb, .gltf, .obj, .ply or .stl (by content, then by ending). Throws Error(input) naming
/// the file, the place in it and what to do; Error(storage) where the file cannot be read at all.
/// Never decodes an image.
mesh::Mesh read_mesh(const std::string& path, const MeshReading& reading = {});

/// An upper bound on the memory that read_mesh() needs for this file at its peak, and the part of
/// it that the returned Mesh keeps. Takes a pass over the text (JSON, OBJ, MTL)
/// or the faces (PLY), none over buffers.
struct MeshCost {
  std::uint64_t peak_bytes = 0;
  std::uint64_t kept_bytes = 0;
};
/// Stops looking, and tells a larger bound, where more than `most_bytes` are sure to be needed
/// only to find out: the text of a glTF file may need far more than its size.
MeshCost mesh_cost(const std::string& path, const MeshReading& reading = {},
                   std::uint64_t most_bytes = UINT64_MAX);

/// Is this read as glTF? Throws as read_mesh() does for what is no mesh file.
bool is_gltf(const std::string& path);

/// The same for each format; the file is taken for one.
mesh::Mesh read_gltf(const std::string& path, const MeshReading& reading);
MeshCost gltf_cost(const std::string& path, const MeshReading& reading, std::uint64_t most_bytes);
mesh::Mesh read_obj(const std::string& path, const MeshReading& reading);
MeshCost obj_cost(const std::string& path, const MeshReading& reading);
mesh::Mesh read_ply(const std::string& path, const MeshReading& reading);
MeshCost ply_cost(const std::string& path, const MeshReading& reading);
mesh::Mesh read_stl(const std::string& path, const MeshReading& reading);
MeshCost stl_cost(const std::string& path);

/// More than these are no sensible model: each costs memory in every stage.
inline constexpr std::size_t kMaxMaterials = 1 << 15;

/// The same names, but none empty (number 3 becomes "material_3") and none twice: a later one gets
/// "_2", "_3", ... appended until it is new. Deterministic.
std::vector<std::string> unique_material_names(std::vector<std::string> names);

}  // namespace pounce::io
