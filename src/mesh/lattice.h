// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/vec.h"
#include "mesh/mesh.h"
#include "mesh/uv_raster.h"
#include "pounce/options.h"

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

/// Of an output: half as large, rounded down, at least 1 each way, as maketx and renderers have it.
constexpr ImageSize next_level_size(ImageSize size) {
  return {size.width > 1 ? size.width / 2 : 1, size.height > 1 ? size.height / 2 : 1};
}

inline Vec2d to_texel(const Lattice& lattice, Vec2f uv) {
  const UvTransform& m = lattice.transform;
  const double u = m.a * uv.x + m.b * uv.y + m.c;
  const double v = m.d * uv.x + m.e * uv.y + m.f;
  return {u * lattice.width - 0.5, v * lattice.height - 0.5};
}

}  // namespace pounce::mesh
