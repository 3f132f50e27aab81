// SPDX-License-Identifier: Apache-2.0
//
// The target's projection maps, evaluated from the stored triangles.
//
// Position and (unnormalised) normal are affine in the texel on each triangle, so a map texel costs
// a few multiplications instead of stored bytes. Each triangle is evaluated from an anchor near the
// block, set up in double precision, so that a triangle of thousands of texels loses nothing far
// from its corners.
#include "target/target_block.h"

#include <algorithm>
#include <cmath>

namespace pounce::target {
namespace {

constexpr int kWindow = 8;        // texels a group spans
constexpr int kHalfWindow = 4;    // texels a packet spans
constexpr float kSpread = 16.0F;  // texel edges beyond which two texels do not share a packet
constexpr int kMostClusters = 4;  // per window; what is left then shares packets, however far apart

struct Gradients {
  Vec3d pu, pv, nu, nv;
  Vec3d p, n;
  Vec2d anchor;
};

/// The affine maps of one triangle around an anchor in texels; nothing if it has no area in the
/// image.
bool gradients(const tiles::GeometryBlock& block, const mesh::Lattice& lattice,
               std::size_t triangle, Gradients& g) {
  const auto t = block.texel_corners(lattice, triangle);
  const double area = mesh::doubled_area(t[0], t[1], t[2]);
  if (area == 0) return false;
  const auto& corner = block.triangles[triangle];
  const double x1 = t[1].x - t[0].x, y1 = t[1].y - t[0].y, x2 = t[2].x - t[0].x,
               y2 = t[2].y - t[0].y;
  const auto solve = [&](Vec3d a, Vec3d b, Vec3d c, Vec3d& du, Vec3d& dv) {
    const Vec3d e1 = b - a, e2 = c - a;
    du = (e1 * y2 - e2 * y1) * (1.0 / area);
    dv = (e2 * x1 - e1 * x2) * (1.0 / area);
  };
  const Vec3d p0(block.positions[corner[0]]), p1(block.positions[corner[1]]),
      p2(block.positions[corner[2]]);
  const Vec3d n0(block.normals[corner[0]]), n1(block.normals[corner[1]]),
      n2(block.normals[corner[2]]);
  solve(p0, p1, p2, g.pu, g.pv);
  solve(n0, n1, n2, g.nu, g.nv);
  const auto [low_x, high_x] = std::minmax({t[0].x, t[1].x, t[2].x});
  const auto [low_y, high_y] = std::minmax({t[0].y, t[1].y, t[2].y});
  const double middle_x = block.x * double{mesh::kBlockEdge} + mesh::kBlockEdge / 2;
  const double middle_y = block.y * double{mesh::kBlockEdge} + mesh::kBlockEdge / 2;
  // Whole texels, so that the distance of a texel to its anchor is exact.
  g.anchor = {std::round(std::clamp(middle_x, low_x, high_x)),
              std::round(std::clamp(middle_y, low_y, high_y))};
  const double dx = g.anchor.x - t[0].x, dy = g.anchor.y - t[0].y;
  g.p = p0 + g.pu * dx + g.pv * dy;
  g.n = n0 + g.nu * dx + g.nv * dy;
  return true;
}

}  // namespace

TargetBlock::TargetBlock(const tiles::GeometryBlock& block, const mesh::Lattice& lattice,
                         float smallest_edge)
    : owner_(block.owner), triangles_(block.triangles.size()) {
  for (std::size_t i = 0; i < block.triangles.size(); ++i) {
    Gradients g;
    if (!gradients(block, lattice, i, g)) continue;  // owns no texel
    Affine& a = triangles_[i];
    a.p = Vec3f(g.p);
    a.pu = Vec3f(g.pu);
    a.pv = Vec3f(g.pv);
    a.n = Vec3f(g.n);
    a.nu = Vec3f(g.nu);
    a.nv = Vec3f(g.nv);
    a.x = static_cast<float>(g.anchor.x - block.x * double{mesh::kBlockEdge});
    a.y = static_cast<float>(g.anchor.y - block.y * double{mesh::kBlockEdge});
    const double edge = std::sqrt(length(cross(g.pu, g.pv)));
    a.per_texel = 1.0F / std::max(static_cast<float>(edge), smallest_edge);
  }
}

TargetBlock::Texel TargetBlock::texel(std::uint32_t texel) const {
  const Affine& a = triangles_[owner_[texel]];
  const float dx = static_cast<float>(texel % mesh::kBlockEdge) - a.x;
  const float dy = static_cast<float>(texel / mesh::kBlockEdge) - a.y;
  Texel out;
  out.position = a.p + (a.pu * dx + a.pv * dy);
  const Vec3f n = a.n + (a.nu * dx + a.nv * dy);
  const float squared = dot(n, n);
  out.normal = squared > 0 ? n * (1.0F / std::sqrt(squared)) : Vec3f{};
  out.per_texel = a.per_texel;
  return out;
}

void TargetBlock::make_packets(std::uint32_t block_index, PageVector<TexelPacket>& packets,
                               std::vector<PacketGroup>& groups) const {
  struct Waiting {
    std::uint16_t index;
    Texel texel;
  };
  std::vector<Waiting> waiting, later;
  const auto pack = [&](const std::vector<Waiting>& texels) {
    for (std::size_t first = 0; first < texels.size(); first += kLanes) {
      TexelPacket& packet = packets.emplace_back();
      packet.block = block_index;
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const bool used = first + lane < texels.size();
        const Texel t =
            used ? texels[first + lane].texel : Texel{texels[first].texel.position, {}, 1};
        packet.px[lane] = t.position.x, packet.py[lane] = t.position.y,
        packet.pz[lane] = t.position.z;
        packet.nx[lane] = t.normal.x, packet.ny[lane] = t.normal.y, packet.nz[lane] = t.normal.z;
        packet.per_texel[lane] = t.per_texel;
        packet.texel[lane] = used ? texels[first + lane].index : kNoTexel;
      }
    }
  };
  for (std::uint32_t window = 0; window < 64; ++window) {
    const std::uint32_t wx = window % 8 * kWindow, wy = window / 8 * kWindow;
    waiting.clear();
    for (std::uint32_t i = 0; i < kWindow * kWindow;
         ++i) {  // 4x4 after 4x4, so that packets are compact
      const std::uint32_t quarter = i / 16, inside = i % 16;
      const std::uint32_t x = wx + quarter % 2 * kHalfWindow + inside % 4;
      const std::uint32_t y = wy + quarter / 2 * kHalfWindow + inside / 4;
      const std::uint32_t index = y * mesh::kBlockEdge + x;
      if (covered(index)) waiting.push_back({static_cast<std::uint16_t>(index), texel(index)});
    }
    // One group of packets per cluster: usually all of the window, one each where charts meet.
    std::vector<Waiting> together;
    for (int cluster = 1; !waiting.empty(); ++cluster) {
      const Texel seed = waiting.front().texel;
      together.clear();
      later.clear();
      for (const Waiting& w : waiting) {
        const Vec3f d = w.texel.position - seed.position;
        const float spread = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
        const bool near = spread * std::min(seed.per_texel, w.texel.per_texel) <= kSpread;
        (near || cluster >= kMostClusters ? together : later).push_back(w);
      }
      const auto first = static_cast<std::uint32_t>(packets.size());
      pack(together);
      groups.push_back({first, static_cast<std::uint32_t>(packets.size()) - first});
      waiting.swap(later);
    }
  }
}

std::vector<Box3f> texel_boxes(const tiles::GeometryBlock& block, const mesh::Lattice& lattice) {
  std::vector<Box3f> boxes(block.triangles.size());
  const TargetBlock map(block, lattice, 1e-30F);
  const auto& owner = block.owner;
  for (std::uint32_t i = 0; i < owner.size(); ++i) {
    // A row's run of one triangle is a straight segment: its ends bound it.
    const bool starts = i % mesh::kBlockEdge == 0 || owner[i - 1] != owner[i];
    const bool ends = i % mesh::kBlockEdge == mesh::kBlockEdge - 1 || owner[i + 1] != owner[i];
    if (owner[i] != tiles::kNoTriangle && (starts || ends))
      boxes[owner[i]].extend(map.texel(i).position);
  }
  std::erase_if(boxes, [](const Box3f& b) { return b.empty(); });
  return boxes;
}

}  // namespace pounce::target
