// SPDX-License-Identifier: Apache-2.0
//
// UVs for a mesh that has none: charts of triangles around which the surface faces about alike,
// unfolded and packed into the unit square, or into several UDIM tiles.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/vec.h"

namespace pounce::unwrap {

using Triangle = std::array<std::uint32_t, 3>;

struct Options {
  std::uint32_t size = 2048;  ///< texels along the image that is to be packed for
  std::uint32_t gutter = 4;   ///< texels between charts, and from the border half as many
  std::uint32_t tiles = 1;    ///< images, which have one scale
  /// What packing may keep of charts in all their turns; it is as good, and slower, with less.
  std::uint64_t masks_bytes = 256 << 20;
};

/// Vertices of their own for each chart: those on its border are there once per chart.
struct Unwrapped {
  std::vector<std::uint32_t> vertex;  ///< of each: the one it was
  std::vector<Vec2f> uvs;             ///< of each, 0..1 within its tile, v downwards
  std::vector<Triangle> triangles;    ///< the same ones in their order, over these vertices
  std::vector<std::uint32_t> charts;  ///< of each triangle
  std::vector<std::uint32_t> tiles;   ///< of each chart, below Options::tiles
  std::uint32_t chart_count = 0;
  double fill = 0;   ///< of all tiles, by triangles
  bool fits = true;  ///< false: so many charts have no room with gutters between them; no UVs
};

/// No two triangles overlap by more than a thousandth of the smaller one. Charts have the area that
/// they have in space, in one scale; of each no more than a tenth is stretched by more than 1.6.
/// Triangles without area are anywhere in a chart of their neighbours. The same at any number of
/// threads: it works on one. `poll` is called often and may throw.
Unwrapped unwrap(
    std::span<const Vec3f> positions, std::span<const Triangle> triangles, const Options& options,
    const std::function<void()>& poll = [] {});

}  // namespace pounce::unwrap
