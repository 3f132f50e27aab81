// SPDX-License-Identifier: Apache-2.0
//
// A surface that keeps its texture's layout: where UVs or materials meet, a place has a vertex for
// each.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"
#include "meshing/surface.h"

namespace pounce::meshing {

/// A vertex as a triangle sees it.
struct Wedge {
  std::uint32_t place = 0;     ///< index into WedgeSurface::places
  std::uint32_t material = 0;  ///< the same at all corners of a triangle
  Vec2f uv;
};

struct WedgeSurface {
  std::vector<Vec3f> places;        ///< no two are equal when it is made
  std::vector<Wedge> wedges;        ///< no two are equal
  std::vector<Triangle> triangles;  ///< of wedges, which lie at three places
};

/// Joins what is the same. `uvs` has those of three corners for each triangle, `materials` one for
/// each. Triangles of which two corners lie at one place go.
WedgeSurface joined(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
                    std::span<const std::array<Vec2f, 3>> uvs,
                    std::span<const std::uint32_t> materials);

/// The same triangles over places alone; its positions are the surface's places.
Surface welded(const WedgeSurface& surface);

/// Numbers wedges and places anew in the order of their first use; others go.
void drop_unused(WedgeSurface& surface);

/// The UVs of a triangle's corners.
std::array<Vec2f, 3> uvs_of(const WedgeSurface& surface, const Triangle& triangle);

/// Twice a triangle's area in its texture; below 0 where it is mirrored.
double turn_of(const std::array<Vec2f, 3>& uvs);

}  // namespace pounce::meshing
