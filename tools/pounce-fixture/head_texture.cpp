// SPDX-License-Identifier: Apache-2.0
#include "head_texture.h"

#include "surface.h"

namespace pounce::fixture {

Rgb HeadTexture::texel(ChartFinder::Found found, std::uint32_t width, std::uint32_t height) const {
  const UvFrame& frame = mesh_[found.chart].uv_sets.front();
  const Vec2d origin = frame.to_grid({0, 0});
  const Vec2d per_x = frame.to_grid({1.0 / width, 0}) - origin;
  const Vec2d per_y = frame.to_grid({0, 1.0 / height}) - origin;
  return area_colour([&](double dx, double dy) {
    return normalized(positions_.at(found.chart, {found.grid.x + dx * per_x.x + dy * per_y.x,
                                                  found.grid.y + dx * per_x.y + dy * per_y.y}));
  });
}

void HeadTexture::rgb_row(std::uint32_t y, std::uint32_t width, std::uint32_t height,
                          std::span<float> row) const {
  ChartFinder finder(mesh_);
  for (std::uint32_t x = 0; x < width; ++x) {
    const Rgb colour = texel(finder.find({(x + 0.5) / width, (y + 0.5) / height}), width, height);
    for (std::size_t c = 0; c < 3; ++c) row[std::size_t{x} * 3 + c] = colour[c];
  }
}

void HeadTexture::truth_row(std::uint32_t y, std::uint32_t width, std::uint32_t height,
                            std::span<float> row) const {
  ChartFinder finder(mesh_);
  for (std::uint32_t x = 0; x < width; ++x) {
    const auto found = finder.find({(x + 0.5) / width, (y + 0.5) / height});
    const Rgb colour = found.inside ? texel(found, width, height) : Rgb{};
    for (std::size_t c = 0; c < 3; ++c) row[std::size_t{x} * 4 + c] = colour[c];
    row[std::size_t{x} * 4 + 3] = found.inside ? 1.0F : 0.0F;
  }
}

}  // namespace pounce::fixture
