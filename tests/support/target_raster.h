// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "mesh/mesh.h"

namespace pounce::test {

/// Which triangle of a mesh's UV set 0 owns each texel of an image, by brute force: edge functions
/// in long double, the top-left rule, the first triangle in file order wins, UVs beyond the image
/// wrap into it. Written apart from the product's rasteriser, so that the two can disagree.
struct TargetRaster {
  std::uint32_t width = 0, height = 0;
  std::vector<std::int32_t> owner;  ///< row-major; -1: no triangle
  /// The texel's centre in the owner's own (unwrapped) texel coordinates.
  std::vector<double> x, y;
  /// 1: some triangle's edge passes so close to the centre that rounding decides.
  std::vector<std::uint8_t> on_edge;

  bool covered(std::size_t texel) const { return owner[texel] >= 0; }
};
TargetRaster raster_target(const mesh::Mesh& mesh, std::uint32_t width, std::uint32_t height);

/// Chart of each triangle: triangles connected over edges whose ends have equal position and equal
/// UV.
std::vector<std::uint32_t> charts(const mesh::Mesh& mesh);

/// 1: a covered texel with an uncovered texel, another chart or the image's border in its 5x5.
std::vector<std::uint8_t> border_band(const mesh::Mesh& mesh, const TargetRaster& raster);

}  // namespace pounce::test
