// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "grid_chart.h"
#include "texture_pattern.h"

namespace pounce::fixture {

/// Paints head_texture on the UV layout of any tessellation of a star-shaped surface: the colour of
/// a texel is the pattern's mean over it, looked up at the direction of the points of the triangle
/// that owns the texel. Gutter texels continue the nearest chart's outermost triangles.
/// Thread-safe; both references must live.
class HeadTexture {
 public:
  HeadTexture(const GridMesh& mesh, const ChartPositions& positions)
      : mesh_(mesh), positions_(positions) {}

  /// Mean colour of texel (x, y) of an image of width x height whose grid place is `found`.
  Rgb texel(ChartFinder::Found found, std::uint32_t width, std::uint32_t height) const;
  /// A row of an RGB image, gutters filled.
  void rgb_row(std::uint32_t y, std::uint32_t width, std::uint32_t height,
               std::span<float> row) const;
  /// A row of an RGBA image: alpha 1 where a chart holds the texel's centre, all zero elsewhere.
  void truth_row(std::uint32_t y, std::uint32_t width, std::uint32_t height,
                 std::span<float> row) const;

 private:
  const GridMesh& mesh_;
  const ChartPositions& positions_;
};

}  // namespace pounce::fixture
