// SPDX-License-Identifier: Apache-2.0
//
// The frames of a normal map's target, interpolated as MikkTSpace prescribes to those who read the
// map: neither normal nor tangent is normalized between the corners (docs/decisions/031). A
// renderer applies the same frames, so a vector comes out as it went in, skew included.
//
// Apart from TargetBlock, since only normal maps and bakes need it, and in double precision, since
// the frame is inverted afterwards.
#include "surface/texel_frames.h"

#include <array>

namespace pounce::surface {

TexelFrames::TexelFrames(const store::GeometryBlock& block, const mesh::Lattice& lattice)
    : block_(block), triangles_(block.triangles.size()) {
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    const auto t = block.texel_corners(lattice, i);
    const double area = mesh::doubled_area(t[0], t[1], t[2]);
    if (area == 0) continue;  // owns no texel
    const Vec2d e1 = t[1] - t[0], e2 = t[2] - t[0];
    triangles_[i] = {t[0].x - block.x * double{mesh::kBlockEdge},
                     t[0].y - block.y * double{mesh::kBlockEdge},
                     e2.y / area,
                     -e2.x / area,
                     -e1.y / area,
                     e1.x / area};
  }
}

TangentFrame TexelFrames::frame(std::uint32_t texel) const {
  const std::uint16_t owner = block_.owner[texel];
  const Barycentrics& b = triangles_[owner];
  const double dx = texel % mesh::kBlockEdge - b.x, dy = texel / mesh::kBlockEdge - b.y;
  const double w1 = b.x1 * dx + b.y1 * dy, w2 = b.x2 * dx + b.y2 * dy;
  std::array<Vec3d, 3> normals, tangents;
  // Tangents are stored in 16 bits per component (geometry_block.cpp).
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint16_t vertex = block_.triangles[owner][k];
    normals[k] = Vec3d(block_.normals[vertex]);
    const auto& t = block_.tangents[vertex];
    tangents[k] = Vec3d{1.0 * t[0], 1.0 * t[1], 1.0 * t[2]} * (1.0 / 32767);
  }
  const auto between = [&](const std::array<Vec3d, 3>& v) {
    return v[0] + ((v[1] - v[0]) * w1 + (v[2] - v[0]) * w2);
  };
  // The first corner speaks for the triangle: where frames are sound, its corners agree.
  const bool is_left = block_.tangents[block_.triangles[owner][0]][3] < 0;
  return usable({between(normals), between(tangents), is_left ? -1.0 : 1.0});
}

}  // namespace pounce::surface
