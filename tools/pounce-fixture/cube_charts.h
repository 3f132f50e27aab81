// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "grid_chart.h"
#include "surface.h"

namespace pounce::fixture {

/// The six faces of the cube that directions are laid out on, `edge_cells` cells along each edge
/// with equal angles. The four side faces follow each other to the right as seen from outside.
enum class CubeFace : std::uint32_t { front, right, back, left, top, bottom };

/// The unit direction of grid point (column, row) of a face; row 0 is the upper edge. Side faces
/// take any column and continue on the next face round the head. Two faces give the same bits along
/// their common edge.
Vec3d cube_direction(CubeFace face, std::uint32_t column, std::uint32_t row,
                     std::uint32_t edge_cells);

/// Turns about the y axis, then about the x axis (degrees). The same input bits give the same
/// output bits, so edges that met still meet.
struct Turn {
  explicit Turn(double y_degrees = 0, double x_degrees = 0);
  Vec3d operator()(Vec3d d) const;

 private:
  double cy_, sy_, cx_, sx_;
};

/// The source's charts: face, back, left, right (upper parts of the cube's sides), top, neck, and a
/// strip round the lower part of all four sides, which meets itself at a seam at the left edge of
/// the front side.
GridMesh head_source_charts(const HeadSurface& surface, std::uint64_t triangle_count);

/// Another tessellation and layout of a surface: a turned cube's six faces in two rows, some turned
/// in the image by angles that are no quarter turns. All inside of UV tile 0.
GridMesh head_target_charts(const HeadSurface& surface, std::uint64_t triangle_count, Turn turn);

/// Six faces in two rows, spread over `uv_tiles` (1 to 6) UDIM tiles.
GridMesh sphere_charts(std::uint64_t triangle_count, std::uint32_t uv_tiles);

}  // namespace pounce::fixture
