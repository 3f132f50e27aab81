// SPDX-License-Identifier: Apache-2.0
#include "head_texture.h"

#include <algorithm>

#include "surface.h"

namespace pounce::fixture {

HeadTexture::HeadTexture(const GridMesh& mesh, std::uint32_t width, std::uint32_t height)
    : mesh_(mesh), positions_(mesh), width_(width), height_(height) {
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const UvFrame to_grid = mesh[i].uv_sets.front().inverse();
    Step step{{to_grid.per_column.x / width, to_grid.per_column.y / width},
              {to_grid.per_row.x / height, to_grid.per_row.y / height},
              0};
    // Each cell's own size: the largest of all is a bound for the chart, and charts are even
    // enough.
    for (std::uint32_t row = 0; row < mesh[i].rows; ++row) {
      for (std::uint32_t column = 0; column < mesh[i].columns; ++column) {
        const Vec3d centre = positions_.at(i, {column + 0.5, row + 0.5});
        const double scale = 1 / length(centre);
        const auto half_diagonal = [&](Vec2d grid) {
          return length(positions_.at(i, {column + 0.5 + grid.x, row + 0.5 + grid.y}) - centre) *
                 scale;
        };
        const Vec2d x = step.per_x, y = step.per_y;
        step.reach = std::max({step.reach, half_diagonal({(x.x + y.x) / 2, (x.y + y.y) / 2}),
                               half_diagonal({(x.x - y.x) / 2, (x.y - y.y) / 2})});
      }
    }
    step.reach *= 1.25;  // within a cell and across its diagonal the size changes by less than that
    steps_.push_back(step);
  }
}

Rgb HeadTexture::texel(const ChartFinder::Found& found) const {
  const Step& step = steps_[found.chart];
  return area_colour(step.reach, [&](double dx, double dy) {
    return normalized(
        positions_.at(found.chart, {found.grid.x + dx * step.per_x.x + dy * step.per_y.x,
                                    found.grid.y + dx * step.per_x.y + dy * step.per_y.y}));
  });
}

void HeadTexture::rgb_row(std::uint32_t y, std::span<float> row) const {
  ChartFinder finder(mesh_);
  for (std::uint32_t x = 0; x < width_; ++x) {
    const Rgb colour = texel(finder.find({(x + 0.5) / width_, (y + 0.5) / height_}));
    for (std::size_t c = 0; c < 3; ++c) row[std::size_t{x} * 3 + c] = colour[c];
  }
}

void HeadTexture::truth_row(std::uint32_t y, std::span<float> row) const {
  ChartFinder finder(mesh_);
  for (std::uint32_t x = 0; x < width_; ++x) {
    const auto found = finder.find({(x + 0.5) / width_, (y + 0.5) / height_});
    const Rgb colour = found.inside ? texel(found) : Rgb{};
    for (std::size_t c = 0; c < 3; ++c) row[std::size_t{x} * 4 + c] = colour[c];
    row[std::size_t{x} * 4 + 3] = found.inside ? 1.0F : 0.0F;
  }
}

}  // namespace pounce::fixture
