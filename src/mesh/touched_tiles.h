// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/lattice.h"
#include "mesh/mesh.h"

namespace pounce::mesh {

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
