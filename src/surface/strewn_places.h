// SPDX-License-Identifier: Apache-2.0
//
// A target's surface without its images: a few places all over it, to ask whether a source lies
// there at all.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "core/vec.h"
#include "mesh/mesh.h"
#include "surface/target_block.h"

namespace pounce::surface {

/// A point of the surface, in space.
struct Place {
  Vec3f position;
  Vec3f normal;  ///< of the triangle, a unit vector on the side that its vertices' normals show
};

/// As many packets as the fullest block of a target has: a block's memory is enough for them.
inline constexpr std::size_t kStrewnPlaces = 448;

/// Places at equal shares of the mesh's area, triangle after triangle: the same for the same mesh,
/// whatever its UVs. Nothing if it has no area.
std::vector<Place> strew(const mesh::Mesh& mesh, std::size_t count = kStrewnPlaces);

/// Of all triangles, in the mesh's units squared.
double surface_area(const mesh::Mesh& mesh);
/// Of some.
double surface_area(const mesh::Mesh& mesh, std::span<const std::uint32_t> triangles);

/// Appends a packet for each place, and a group, since places lie far apart: the first lane looks
/// for it as a texel of this edge. Place i is in block i.
void make_packets(std::span<const Place> places, float edge, PageVector<TexelPacket>& packets,
                  std::vector<PacketGroup>& groups);

// --- layers --------------------------------------------------------------------------------------
//
// Layers of a surface that face alike and lie close together: a shirt on a body, two sides of a
// collar. A target whose own triangles stray farther from the source's than the layers lie apart
// finds now the one and now the other.

/// For each place on a mesh the distance along its normal, either way, of the nearest other part of
/// the mesh that faces like it (the cosine of their normals is at least `least_cosine`); infinite
/// where none is within `most`. What lies within a millionth of `most` is the place's own:
/// triangles that meet there, or coincide. The same for the same mesh; no threads.
std::vector<float> layer_gaps(const mesh::Mesh& mesh, std::span<const Place> places,
                              float least_cosine, float most);

}  // namespace pounce::surface
