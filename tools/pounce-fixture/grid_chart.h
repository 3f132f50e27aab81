// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/vec.h"
#include "surface.h"

namespace pounce::fixture {

/// An affine map from grid coordinates (column to the right, row down) to UV in glTF's convention
/// (v down).
struct UvFrame {
  Vec2d origin;      ///< UV of grid point (0, 0)
  Vec2d per_column;  ///< UV step of one column
  Vec2d per_row;     ///< UV step of one row

  Vec2d to_uv(Vec2d grid) const {
    return {origin.x + grid.x * per_column.x + grid.y * per_row.x,
            origin.y + grid.x * per_column.y + grid.y * per_row.y};
  }
  Vec2d to_grid(Vec2d uv) const { return inverse().to_uv(uv); }
  /// The map back: its to_uv() takes UV to grid coordinates.
  UvFrame inverse() const;
};

/// The frame that fits `columns` x `rows` cells into the box of UV space with corner `corner`
/// (least u and v) and size `size`, turned clockwise (as seen in the image) by 0 to 3 quarter
/// turns.
UvFrame fit_frame(std::uint32_t columns, std::uint32_t rows, Vec2d corner, Vec2d size,
                  int quarter_turns = 0);
/// The same frame turned by any angle (degrees, clockwise in a square image) about its chart's
/// centre and scaled about it.
UvFrame turned(UvFrame frame, std::uint32_t columns, std::uint32_t rows, double degrees,
               double scale);

/// A chart that is a rectangular grid of cells, each cut into two triangles along its diagonal from
/// the upper left to the lower right: (upper left, lower left, lower right), then (upper left,
/// lower right, upper right). Seen from outside, columns run to the right and rows downward.
struct GridChart {
  std::string name;
  std::uint32_t columns = 0, rows = 0;  ///< cells; there is one more grid point each way
  std::vector<UvFrame> uv_sets;
  /// Grid point -> position and outward normal. A pure function: called again whenever the value is
  /// needed, so that a mesh of any size takes no memory. Thread-safe.
  std::function<SurfacePoint(std::uint32_t column, std::uint32_t row)> point;

  std::uint64_t vertex_count() const { return (std::uint64_t{columns} + 1) * (rows + 1); }
  std::uint64_t triangle_count() const { return std::uint64_t{2} * columns * rows; }
  /// Does the chart hold this place (half open: the first column and row belong to it)?
  bool holds(Vec2d grid) const {
    return grid.x >= 0 && grid.x < columns && grid.y >= 0 && grid.y < rows;
  }
};

using GridMesh = std::vector<GridChart>;

/// The charts' grid points as they are stored in a file (rounded to float), for looking up surface
/// points.
class ChartPositions {
 public:
  explicit ChartPositions(const GridMesh& mesh);
  /// The point of the triangle that owns `grid`; outside of the chart the nearest cell's triangle,
  /// extended.
  Vec3d at(std::size_t chart, Vec2d grid) const;

 private:
  struct Table {
    std::uint32_t columns, rows;
    std::vector<Vec3f> points;
  };
  std::vector<Table> tables_;
};

/// Which chart a texel belongs to: the one that holds its centre, else the nearest within reach in
/// UV space (a gutter texel), else none. Remembers the last answer, as neighbours have the same;
/// one per thread.
class ChartFinder {
 public:
  struct Found {
    std::size_t chart;
    Vec2d grid;
    bool inside;
  };
  explicit ChartFinder(const GridMesh& mesh, std::size_t uv_set = 0);
  Found find(Vec2d uv);

 private:
  const GridMesh& mesh_;
  std::size_t uv_set_;
  std::vector<UvFrame> to_grid_;  // inverse frames
  std::size_t last_ = 0;
};

}  // namespace pounce::fixture
