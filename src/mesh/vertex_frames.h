// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "mesh/mesh.h"

namespace pounce::mesh {

/// Makes every normal of `mesh` a unit vector. One that is zero or not finite becomes the
/// area-weighted mean of its triangles' normals (zero where they have no area). Returns how many
/// were replaced.
std::uint64_t repair_normals(Mesh& mesh);

/// Makes every tangent a unit vector orthogonal to its normal with w = +1 or -1. One that is zero
/// or not finite is derived: the area-weighted mean direction of growing u in uv set 0 around the
/// vertex; where there are no UVs, or they cancel out, any direction with w = 1. The sign follows
/// glTF's: w * cross(normal, tangent) points to where v falls (up in the image). Needs normals.
/// Notes which were there (Mesh::own_tangents). Returns how many were derived.
std::uint64_t complete_tangents(Mesh& mesh);

/// Normals for a mesh without them: per corner, the area-weighted mean of the triangles around its
/// position whose normals are within `max_angle_deg` of its own triangle's. Vertices whose corners
/// differ are split (the copies come last). `position_of[vertex]` tells which vertices share a
/// position: equal numbers, below `position_count`. Only vertices with `missing[vertex]` are
/// touched.
void smooth_normals(Mesh& mesh, const std::vector<std::uint32_t>& position_of,
                    std::uint32_t position_count, const std::vector<bool>& missing,
                    double max_angle_deg);

}  // namespace pounce::mesh
