// SPDX-License-Identifier: Apache-2.0
#include "gaussian/texel_neighbours.h"

#include <algorithm>
#include <cmath>

#include "mesh/uv_raster.h"

namespace pounce::gaussian {

TexelNeighbours::TexelNeighbours() : spots_(std::size_t{kEdge} * kEdge) {}

void TexelNeighbours::start(std::int32_t block_x, std::int32_t block_y) {
  left_ = std::int64_t{block_x} * mesh::kBlockEdge - kMargin;
  top_ = std::int64_t{block_y} * mesh::kBlockEdge - kMargin;
  std::fill(spots_.begin(), spots_.end(), Spot{});
}

void TexelNeighbours::add(const store::GeometryBlock& block, const mesh::Lattice& lattice) {
  const std::int64_t x0 = std::int64_t{block.x} * mesh::kBlockEdge,
                     y0 = std::int64_t{block.y} * mesh::kBlockEdge;
  for (std::size_t t = 0; t < block.triangles.size(); ++t) {
    const std::array<Vec2d, 3> texels = block.texel_corners(lattice, t);
    const double area = mesh::doubled_area(texels[0], texels[1], texels[2]);
    if (area == 0) continue;
    const auto corner = [&](std::size_t k) {
      return Vec3d(block.positions[block.triangles[t][k]]);
    };
    const Vec3d origin = corner(0), e1 = corner(1) - origin, e2 = corner(2) - origin;
    mesh::TexelWindow window{left_, top_, left_ + kEdge, top_ + kEdge};
    if (!mesh::is_whole(texels, lattice)) {  // its other parts are in other blocks
      window = {std::max(window.x0, x0), std::max(window.y0, y0),
                std::min(window.x1, x0 + mesh::kBlockEdge),
                std::min(window.y1, y0 + mesh::kBlockEdge)};
    }
    mesh::raster_triangle(texels, window, [&](std::int64_t y, std::int64_t from, std::int64_t to) {
      for (std::int64_t x = from; x < to; ++x) {
        Spot& spot = spots_[static_cast<std::size_t>((y - top_) * kEdge + x - left_)];
        if (spot.layers == kLayers) continue;
        const Vec2d p{static_cast<double>(x), static_cast<double>(y)};
        const double w1 = mesh::doubled_area(texels[0], p, texels[2]) / area;
        const double w2 = mesh::doubled_area(texels[0], texels[1], p) / area;
        spot.places[spot.layers++] = Vec3f(origin + e1 * w1 + e2 * w2);
      }
    });
  }
}

bool TexelNeighbours::continues(const MeshGaussian& g, const TexelFrame& frame, int dx,
                                int dy) const {
  const std::int64_t x = std::int64_t{g.x} + dx, y = std::int64_t{g.y} + dy;
  if (x >= left_ && x < left_ + kEdge && y >= top_ && y < top_ + kEdge) {
    const Spot& spot = spots_[static_cast<std::size_t>((y - top_) * kEdge + x - left_)];
    // On a flat surface it is a texel's edge away for each step; twice that allows for bends.
    const double reach = 2 * frame.edge * std::sqrt(static_cast<double>(dx * dx + dy * dy));
    const Vec3d here(g.mean);
    for (std::size_t k = 0; k < spot.layers; ++k) {
      const Vec3d to = Vec3d(spot.places[k]) - here;
      if (dot(to, to) <= reach * reach) return true;
    }
    return false;
  }
  const Vec2d p{static_cast<double>(x), static_cast<double>(y)};
  const auto& t = frame.texels;
  for (std::size_t k = 0; k < 3; ++k) {
    if (mesh::doubled_area(t[k], t[(k + 1) % 3], p) * frame.doubled_area < 0) return false;
  }
  return true;
}

}  // namespace pounce::gaussian
