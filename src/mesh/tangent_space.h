// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/mesh.h"

namespace pounce::mesh {

/// Tangents of triangles' corners. Corners that share their frame share an entry.
struct CornerTangents {
  std::vector<std::uint32_t> of_corner;  ///< 3 per triangle: index into `tangents`
  /// Unit tangent along growing u, in the plane of the corner's normal, and handedness +1/-1 in
  /// glTF's sense: w * cross(normal, tangent) points to where v falls, up in the image. Where
  /// nothing is known (1, 0, 0), whatever the normal is.
  std::vector<Vec4f> tangents;
};

/// MikkTSpace: the tangent space that bakers and renderers agree on where a file has none. It
/// depends on the corners' positions, normals and UVs and on the order of triangles, not on how
/// vertices are shared; triangles of one material and those of another do not mix, as glTF's
/// primitives do not. `uv_set_of[material]` says which UVs count; a triangle that lacks them gets
/// no frame. The same bits on every machine. Needs unit normals.
CornerTangents mikk_tangents(const Mesh& mesh, const std::vector<std::uint32_t>& uv_set_of);

/// Gives each corner its tangent, from mikk_tangents() unless its vertex has one of its own
/// (Mesh::own_tangents) and `keeps_own[material]`. Vertices whose corners differ are split, the
/// copies come last; triangles keep their order. Returns how many vertices were added.
std::uint64_t set_tangents(Mesh& mesh, const std::vector<std::uint32_t>& uv_set_of,
                           const std::vector<bool>& keeps_own);

/// Bytes that set_tangents() needs beside the mesh, at most, what it adds to the mesh included.
std::uint64_t tangents_bytes(const Mesh& mesh);

}  // namespace pounce::mesh
