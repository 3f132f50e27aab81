// SPDX-License-Identifier: Apache-2.0
#include "grid_chart.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace pounce::fixture {

UvFrame UvFrame::inverse() const {
  const double determinant = per_column.x * per_row.y - per_column.y * per_row.x;
  const Vec2d per_u{per_row.y / determinant, -per_column.y / determinant};
  const Vec2d per_v{-per_row.x / determinant, per_column.x / determinant};
  return {{-origin.x * per_u.x - origin.y * per_v.x, -origin.x * per_u.y - origin.y * per_v.y},
          per_u,
          per_v};
}

UvFrame fit_frame(std::uint32_t columns, std::uint32_t rows, Vec2d corner, Vec2d size,
                  int quarter_turns) {
  const double w = size.x, h = size.y, x = corner.x, y = corner.y;
  const double c = columns, r = rows;
  switch (quarter_turns % 4) {
    case 1:  // columns run down, rows run left
      return {{x + w, y}, {0, h / c}, {-w / r, 0}};
    case 2:
      return {{x + w, y + h}, {-w / c, 0}, {0, -h / r}};
    case 3:
      return {{x, y + h}, {0, -h / c}, {w / r, 0}};
    default:
      return {{x, y}, {w / c, 0}, {0, h / r}};
  }
}

UvFrame turned(UvFrame frame, std::uint32_t columns, std::uint32_t rows, double degrees,
               double scale) {
  const double angle = degrees * 3.14159265358979323846 / 180;
  const double c = std::cos(angle) * scale, s = std::sin(angle) * scale;
  const auto turn = [&](Vec2d v) { return Vec2d{c * v.x - s * v.y, s * v.x + c * v.y}; };
  const Vec2d centre = frame.to_uv({columns * 0.5, rows * 0.5});
  return {centre + turn(frame.origin - centre), turn(frame.per_column), turn(frame.per_row)};
}

ChartPositions::ChartPositions(const GridMesh& mesh) {
  for (const GridChart& chart : mesh) {
    Table table{chart.columns, chart.rows, std::vector<Vec3f>(chart.vertex_count())};
    tbb::parallel_for(std::uint32_t{0}, chart.rows + 1, [&](std::uint32_t row) {
      for (std::uint32_t column = 0; column <= chart.columns; ++column) {
        table.points[std::uint64_t{row} * (chart.columns + 1) + column] =
            Vec3f(chart.point(column, row).position);
      }
    });
    tables_.push_back(std::move(table));
  }
}

Vec3d ChartPositions::at(std::size_t chart, Vec2d grid) const {
  const Table& table = tables_[chart];
  const double column = std::clamp(std::floor(grid.x), 0.0, table.columns - 1.0);
  const double row = std::clamp(std::floor(grid.y), 0.0, table.rows - 1.0);
  const double fx = grid.x - column, fy = grid.y - row;
  const std::size_t stride = std::size_t{table.columns} + 1;
  const Vec3f* upper =
      &table.points[static_cast<std::size_t>(row) * stride + static_cast<std::size_t>(column)];
  const Vec3f* lower = upper + stride;
  const Vec3d upper_left(upper[0]), lower_right(lower[1]);
  if (fy > fx) {
    const Vec3d lower_left(lower[0]);
    return upper_left + (lower_left - upper_left) * fy + (lower_right - lower_left) * fx;
  }
  const Vec3d upper_right(upper[1]);
  return upper_left + (upper_right - upper_left) * fx + (lower_right - upper_right) * fy;
}

ChartFinder::ChartFinder(const GridMesh& mesh, std::size_t uv_set) : mesh_(mesh), uv_set_(uv_set) {
  for (const GridChart& chart : mesh) to_grid_.push_back(chart.uv_sets[uv_set].inverse());
}

ChartFinder::Found ChartFinder::find(Vec2d uv) {
  const Vec2d guess = to_grid_[last_].to_uv(uv);
  if (mesh_[last_].holds(guess)) return {last_, guess, true};
  Found best{0, {}, false};
  double best_distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < mesh_.size(); ++i) {
    const GridChart& chart = mesh_[i];
    const UvFrame& frame = chart.uv_sets[uv_set_];
    const Vec2d grid = to_grid_[i].to_uv(uv);
    const Vec2d nearest = frame.to_uv({std::clamp(grid.x, 0.0, double{chart.columns * 1.0}),
                                       std::clamp(grid.y, 0.0, double{chart.rows * 1.0})});
    const bool inside = chart.holds(grid);
    const Vec2d away = uv - nearest;
    const double distance = inside ? -1 : away.x * away.x + away.y * away.y;
    if (distance < best_distance) {
      best_distance = distance;
      best = {i, grid, inside};
    }
  }
  last_ = best.chart;
  return best;
}

}  // namespace pounce::fixture
