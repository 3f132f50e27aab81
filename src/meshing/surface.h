// SPDX-License-Identifier: Apache-2.0
//
// A surface on its way from a field to a mesh: triangles over shared vertices.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/bounds.h"
#include "core/vec.h"

namespace pounce::meshing {

using Triangle = std::array<std::uint32_t, 3>;

struct Surface {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
};

/// Along a triangle's normal, as long as its area.
Vec3d area_vector(const std::vector<Vec3f>& positions, const Triangle& triangle);

/// Numbers vertices anew in the order of their first use; those that no triangle has go.
void drop_unused(Surface& surface);

/// Drops connected parts whose area is less than `share` of the largest one's, and vertices that no
/// triangle has.
void keep_large_parts(Surface& surface, double share);

/// Moves vertices towards the mean of their neighbours and, a little farther, back: what is uneven
/// goes, and the volume stays (Taubin 1995). Vertices on a border stay.
void smooth(Surface& surface, int rounds);

/// To at most so many triangles, as far as its shape allows, by quadric errors (meshoptimizer).
void simplify(Surface& surface, std::size_t triangles);
/// To as few triangles as keep it within about this distance, above 0.
void simplify_within(Surface& surface, double distance);
/// The box of its vertices.
Box3f box_of(const Surface& surface);

/// For each vertex: of its triangles' normals, weighed by their areas. Unit vectors.
std::vector<Vec3f> normals_of(const Surface& surface);

}  // namespace pounce::meshing
