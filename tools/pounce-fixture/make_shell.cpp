// SPDX-License-Identifier: Apache-2.0
//
// A plate 1 wide and 2 high, bent round the y axis. Its outer and inner sides are two charts, two
// texels of the source's texture apart, facing away from each other. The colours are waves of at
// least 64 texels at any texture size, so bilinear filtering alone costs less than 1e-3, and the
// two sides differ by about half the range everywhere: a lookup that takes the wrong side shows at
// once.
#include <cmath>

#include "grid_chart.h"
#include "output_file.h"
#include "recipes.h"
#include "texture_pattern.h"
#include "write_textured_mesh.h"

namespace pounce::fixture {
namespace {

constexpr std::uint32_t kColumns = 24, kRows = 48;
constexpr double kChartWidth = 0.46, kChartHeight = 0.92;  // of the source's image
constexpr double kEdge = 0.0203;                           // gutter at the image's border

/// `across` and `down` are 0..1 on the plate, seen from outside; `offset` is along the outward
/// normal.
SurfacePoint plate_point(double across, double down, double offset, bool inner) {
  constexpr double kRadius = 1.2;
  const double angle = (across - 0.5) / kRadius;
  const Vec3d outward{std::sin(angle), 0, std::cos(angle)};
  const Vec3d p = outward * (kRadius + offset);
  return {{p.x, 2 * (0.5 - down), p.z}, inner ? outward * -1.0 : outward};
}

Rgb side_colour(double across, double down, bool inner) {
  const auto a = static_cast<float>(cosine_turns(1.7 * across + 1.1 * down));
  const auto b = static_cast<float>(cosine_turns(0.9 * across - 3.1 * down + 0.3));
  const Rgb outer{0.72F + 0.12F * a, 0.30F + 0.12F * b, 0.25F + 0.08F * a - 0.06F * b};
  if (!inner) return outer;
  return {1.0F - outer[0], 0.95F - outer[1], 1.0F - outer[2]};
}

/// Outer and inner side; columns run to the right as seen from the side's own front.
GridMesh shell_charts(std::uint32_t texture_size) {
  const double half_thickness = 1 / (kChartWidth * texture_size);  // one texel
  GridMesh mesh;
  for (const bool inner : {false, true}) {
    GridChart chart;
    chart.name = inner ? "inner" : "outer";
    chart.columns = kColumns;
    chart.rows = kRows;
    chart.point = [=](std::uint32_t column, std::uint32_t row) {
      const double along = column / (1.0 * kColumns), down = row / (1.0 * kRows);
      return plate_point(inner ? 1 - along : along, down, inner ? -half_thickness : half_thickness,
                         inner);
    };
    mesh.push_back(std::move(chart));
  }
  return mesh;
}

Rgb chart_colour(const ChartFinder::Found& found) {
  const bool inner = found.chart == 1;
  const double along = found.grid.x / kColumns;
  return side_colour(inner ? 1 - along : along, found.grid.y / kRows, inner);
}

}  // namespace

Paths make_shell(const ShellOptions& options) {
  make_folder(options.folder);
  Paths written;
  const std::uint32_t size = options.texture_size;
  const auto paint = [size](const GridMesh& mesh, std::uint32_t y, std::span<float> row,
                            bool is_truth) {
    ChartFinder finder(mesh);
    const std::size_t channels = is_truth ? 4 : 3;
    for (std::uint32_t x = 0; x < size; ++x) {
      const auto found = finder.find({(x + 0.5) / size, (y + 0.5) / size});
      const Rgb colour = is_truth && !found.inside ? Rgb{} : chart_colour(found);
      for (std::size_t c = 0; c < 3; ++c) row[x * channels + c] = colour[c];
      if (is_truth) row[x * channels + 3] = found.inside ? 1.0F : 0.0F;
    }
  };
  GridMesh source = shell_charts(size);
  for (const std::uint32_t side : {0U, 1U}) {
    source[side].uv_sets = {fit_frame(kColumns, kRows, {kEdge + 0.5 * side, kEdge + 0.01},
                                      {kChartWidth, kChartHeight})};
  }
  write_textured_mesh(
      {options.folder + "/shell_src", true, false, "png"}, source, {.width = size, .height = size},
      [&](std::uint32_t y, std::span<float> row) { paint(source, y, row, false); }, written);
  GridMesh target = shell_charts(size);
  for (const std::uint32_t side : {0U, 1U}) {
    target[side].uv_sets = {fit_frame(kColumns, kRows, {kEdge + 0.01, kEdge + 0.5 * (1 - side)},
                                      {kChartHeight, kChartWidth}, side == 0 ? 1 : 3)};
  }
  write_plain_mesh({options.folder + "/shell_target", true, false, {}}, target, written);
  written.push_back(options.folder + "/shell_target.truth.png");
  render_image(written.back(), {.width = size, .height = size, .channels = 4, .depth = Depth::u16},
               [&](std::uint32_t y, std::span<float> row) { paint(target, y, row, true); });
  return written;
}

}  // namespace pounce::fixture
