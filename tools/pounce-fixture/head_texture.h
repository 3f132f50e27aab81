// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "grid_chart.h"
#include "texture_pattern.h"

namespace pounce::fixture {

/// Paints texture_pattern on the UV layout of any tessellation of a star-shaped surface, as an
/// image of width x height: the colour of a texel is the pattern's mean over it, looked up at the
/// direction of the points of the triangle that owns the texel. Gutter texels continue the nearest
/// chart's outermost triangles. Thread-safe; `mesh` must live.
class HeadTexture {
 public:
  HeadTexture(const GridMesh& mesh, std::uint32_t width, std::uint32_t height);

  /// Mean colour of the texel whose centre is at the grid place `found`.
  Rgb texel(const ChartFinder::Found& found) const;
  /// A row of an RGB image, gutters filled.
  void rgb_row(std::uint32_t y, std::span<float> row) const;
  /// A row of an RGBA image: alpha 1 where a chart holds the texel's centre, all zero elsewhere.
  void truth_row(std::uint32_t y, std::span<float> row) const;

 private:
  /// One texel's step in a chart's grid, and the largest angle from any of its texels' centres to a
  /// corner.
  struct Step {
    Vec2d per_x, per_y;
    double reach;
  };
  const GridMesh& mesh_;
  ChartPositions positions_;
  std::uint32_t width_, height_;
  std::vector<Step> steps_;  // by chart
};

}  // namespace pounce::fixture
