// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/vec.h"
#include "mesh/mesh.h"

namespace pounce::mesh {

/// Edge of a block of texels: the unit of storage.
inline constexpr int kBlockEdge = 64;
/// Unwrapped texel coordinates beyond this are a broken file.
inline constexpr double kLargestTexel = 1e9;

/// How UVs of one page become texel coordinates. A page is one image of the target, or one material
/// of the source with the image size it samples: each has a lattice of its own. Texel coordinates:
/// (x, y) has its centre at integers, row 0 on top, so x = u W - 1/2, y = v H - 1/2 with v down.
/// They are not wrapped: a chart that leaves the image goes on.
struct Lattice {
  std::uint32_t width = 0;  ///< 0: the page has no image; its triangles have one constant colour
  std::uint32_t height = 0;
  std::uint32_t uv_set = 0;
  UvTransform transform;
  bool operator==(const Lattice&) const = default;
};

inline Vec2d to_texel(const Lattice& lattice, Vec2f uv) {
  const UvTransform& m = lattice.transform;
  const double u = m.a * uv.x + m.b * uv.y + m.c;
  const double v = m.d * uv.x + m.e * uv.y + m.f;
  return {u * lattice.width - 0.5, v * lattice.height - 0.5};
}

/// Twice the signed area of a triangle in texels.
inline double doubled_area(Vec2d a, Vec2d b, Vec2d c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

}  // namespace pounce::mesh
