// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

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

// --- tiles that triangles touch ------------------------------------------------------------------

/// Some of an image's tiles of kBlockEdge x kBlockEdge texels.
class TileMask {
 public:
  /// None of the tiles of an image of that size.
  TileMask(std::uint32_t width, std::uint32_t height);

  std::uint32_t tiles_x() const { return tiles_x_; }
  std::uint32_t tiles_y() const { return tiles_y_; }
  std::uint64_t tiles() const { return tiles_.size(); }
  std::uint64_t count() const;  ///< of those that are in it
  bool has(std::uint32_t x, std::uint32_t y) const { return tiles_[at(x, y)] != 0; }
  bool has_row(std::uint32_t y) const;  ///< any tile of that row
  std::uint32_t end_row() const;        ///< after the last row that has a tile
  /// Adds the tiles that hold these texels, ends included, all inside the image.
  void add(std::uint32_t x0, std::uint32_t x1, std::uint32_t y0, std::uint32_t y1);
  void add_all();
  /// One byte a tile, row by row: 1 where it is in the mask.
  std::span<const std::uint8_t> bytes() const { return tiles_; }

 private:
  std::size_t at(std::uint32_t x, std::uint32_t y) const { return std::size_t{y} * tiles_x_ + x; }

  std::uint32_t width_, height_, tiles_x_, tiles_y_;
  std::vector<std::uint8_t> tiles_;
};

/// Adds to `mask` every tile of the lattice's image that holds a texel within `margin` texels (in
/// both directions) of one of the triangles, where its wrap modes bring texels beyond the image.
/// May add a few more. The mask is of an image of the lattice's size.
void add_touched(const Mesh& mesh, const Lattice& lattice, std::span<const std::uint32_t> triangles,
                 Wrap wrap_u, Wrap wrap_v, double margin, TileMask& mask);

/// The area of the triangles in texels of the lattice's image, those that lie on each other counted
/// each.
double texel_area(const Mesh& mesh, const Lattice& lattice,
                  std::span<const std::uint32_t> triangles);

}  // namespace pounce::mesh
