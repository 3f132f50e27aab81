// SPDX-License-Identifier: Apache-2.0
#include "cube_charts.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

namespace pounce::fixture {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// The gutters of all layouts lie at thousandths plus this, so that no chart's edge runs through
/// texel centres of an image whose size people use (there, float UVs would decide by their rounding
/// who owns a texel).
constexpr double kOffCentre = 0.0003;

/// Cube coordinate of grid line `k` of `n`, -1 to 1; odd in k about the middle, to the bit.
double cube_coordinate(std::uint32_t k, std::uint32_t n) {
  if (k == 0) return -1;
  if (k == n) return 1;
  return std::tan((2.0 * k - n) * kPi / (4.0 * n));
}

std::uint32_t edge_cells_for(std::uint64_t triangle_count) {
  const double cells = std::sqrt(static_cast<double>(triangle_count) / 12);
  return std::max(3U, static_cast<std::uint32_t>(std::lround(cells)));
}

using SharedSurface = std::shared_ptr<const HeadSurface>;

/// A chart of `columns` x `rows` cells that begins at `first_row` of a cube face.
GridChart face_chart(SharedSurface surface, const char* name, CubeFace face,
                     std::uint32_t first_row, std::uint32_t columns, std::uint32_t rows,
                     std::uint32_t edge_cells, Turn turn) {
  GridChart chart;
  chart.name = name;
  chart.columns = columns;
  chart.rows = rows;
  chart.point = [=](std::uint32_t column, std::uint32_t row) {
    return surface->point(turn(cube_direction(face, column, first_row + row, edge_cells)));
  };
  return chart;
}

void place(GridChart& chart, Vec2d corner, Vec2d size, int quarter_turns = 0) {
  chart.uv_sets.push_back(fit_frame(chart.columns, chart.rows,
                                    {corner.x + kOffCentre, corner.y + kOffCentre}, size,
                                    quarter_turns));
}

}  // namespace

Vec3d cube_direction(CubeFace face, std::uint32_t column, std::uint32_t row,
                     std::uint32_t edge_cells) {
  auto side = static_cast<std::uint32_t>(face);
  const double up = -cube_coordinate(row, edge_cells);
  if (face == CubeFace::top || face == CubeFace::bottom) {
    const double right = cube_coordinate(column, edge_cells);
    return normalized(face == CubeFace::top ? Vec3d{right, 1, -up} : Vec3d{right, -1, up});
  }
  side = (side + column / edge_cells) % 4;
  const double right = cube_coordinate(column % edge_cells, edge_cells);
  switch (static_cast<CubeFace>(side)) {
    case CubeFace::right:
      return normalized(Vec3d{1, up, -right});
    case CubeFace::back:
      return normalized(Vec3d{-right, up, -1});
    case CubeFace::left:
      return normalized(Vec3d{-1, up, right});
    default:
      return normalized(Vec3d{right, up, 1});
  }
}

Turn::Turn(double y_degrees, double x_degrees)
    : cy_(std::cos(y_degrees * kPi / 180)),
      sy_(std::sin(y_degrees * kPi / 180)),
      cx_(std::cos(x_degrees * kPi / 180)),
      sx_(std::sin(x_degrees * kPi / 180)) {}

Vec3d Turn::operator()(Vec3d d) const {
  const Vec3d about_y{cy_ * d.x + sy_ * d.z, d.y, cy_ * d.z - sy_ * d.x};
  return {about_y.x, cx_ * about_y.y - sx_ * about_y.z, sx_ * about_y.y + cx_ * about_y.z};
}

GridMesh head_source_charts(const HeadSurface& head, std::uint64_t triangle_count) {
  const auto surface = std::make_shared<const HeadSurface>(head);
  const std::uint32_t n = edge_cells_for(triangle_count);
  const std::uint32_t upper =
      std::max(1U, n * 13 / 20);  // the strip is the lower 35 % of the sides
  const Turn none;
  const auto side = [&](const char* name, CubeFace face) {
    return face_chart(surface, name, face, 0, n, upper, n, none);
  };
  GridMesh mesh{side("face", CubeFace::front),
                side("back", CubeFace::back),
                side("left", CubeFace::left),
                side("right", CubeFace::right),
                face_chart(surface, "top", CubeFace::top, 0, n, n, n, none),
                face_chart(surface, "neck", CubeFace::bottom, 0, n, n, n, none),
                face_chart(surface, "strip", CubeFace::front, upper, 4 * n, n - upper, n, none)};
  place(mesh[0], {0.020, 0.020}, {0.470, 0.310});
  place(mesh[1], {0.510, 0.020}, {0.470, 0.310});
  place(mesh[2], {0.020, 0.350}, {0.320, 0.490}, 1);
  place(mesh[3], {0.680, 0.350}, {0.300, 0.490}, 3);
  place(mesh[4], {0.360, 0.350}, {0.300, 0.290});
  place(mesh[5], {0.360, 0.660}, {0.300, 0.180});
  place(mesh[6], {0.020, 0.860}, {0.960, 0.120});
  return mesh;
}

GridMesh head_target_charts(const HeadSurface& head, std::uint64_t triangle_count, Turn turn) {
  const auto surface = std::make_shared<const HeadSurface>(head);
  const std::uint32_t n = edge_cells_for(triangle_count);
  constexpr const char* kNames[] = {"front", "right", "back", "left", "top", "bottom"};
  struct Tilt {
    double degrees;  // in the image
    Vec2d size;      // so that the tilted chart still fits into its box of 0.31 x 0.45
  };
  constexpr Vec2d kBox{0.310, 0.450};
  constexpr Tilt kTilts[] = {{0, kBox}, {9, {0.250, 0.390}}, {0, kBox}, {-14, {0.225, 0.380}},
                             {0, kBox}, {8, {0.255, 0.400}}};
  GridMesh mesh;
  for (std::uint32_t face = 0; face < 6; ++face) {
    GridChart chart =
        face_chart(surface, kNames[face], static_cast<CubeFace>(face), 0, n, n, n, turn);
    const Tilt& tilt = kTilts[face];
    const Vec2d corner{0.017 + 0.328 * (face % 3) + (kBox.x - tilt.size.x) / 2,
                       0.035 + 0.480 * (face / 3) + (kBox.y - tilt.size.y) / 2};
    place(chart, corner, tilt.size, static_cast<int>(face % 4));
    chart.uv_sets[0] = turned(chart.uv_sets[0], n, n, tilt.degrees, 1);
    mesh.push_back(std::move(chart));
  }
  return mesh;
}

GridMesh sphere_charts(std::uint64_t triangle_count, std::uint32_t uv_tiles) {
  const auto surface = std::make_shared<const HeadSurface>(unit_sphere());
  const std::uint32_t n = edge_cells_for(triangle_count);
  constexpr const char* kNames[] = {"front", "right", "back", "left", "top", "bottom"};
  GridMesh mesh;
  for (std::uint32_t face = 0; face < 6; ++face) {
    GridChart chart =
        face_chart(surface, kNames[face], static_cast<CubeFace>(face), 0, n, n, n, Turn());
    const double tile = face * uv_tiles / 6;
    place(chart, {tile + 0.010 + 0.330 * (face % 3), 0.010 + 0.490 * (face / 3)}, {0.310, 0.470});
    mesh.push_back(std::move(chart));
  }
  return mesh;
}

}  // namespace pounce::fixture
