// SPDX-License-Identifier: Apache-2.0
//
// Fills packets with the maps of a block's texels: where their rays start, and where to.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "surface/target_block.h"

namespace pounce::surface {
namespace {

// Enough for the own side of an edge to win against rounding, which is worth a few steps.
constexpr float kInsetSteps = 32;

/// The first three of each of four vectors, by component.
template <class Four>
void turn_over(const std::array<Four, 4>& v, float* x, float* y, float* z) {
  const Four low = __builtin_shufflevector(v[0], v[1], 0, 4, 1, 5),
             high = __builtin_shufflevector(v[2], v[3], 0, 4, 1, 5),
             low_z = __builtin_shufflevector(v[0], v[1], 2, 6, 3, 7),
             high_z = __builtin_shufflevector(v[2], v[3], 2, 6, 3, 7);
  const auto put = [](Four values, float* to) { std::memcpy(to, &values, sizeof values); };
  put(__builtin_shufflevector(low, high, 0, 1, 4, 5), x);
  put(__builtin_shufflevector(low, high, 2, 3, 6, 7), y);
  put(__builtin_shufflevector(low_z, high_z, 0, 1, 4, 5), z);
}

/// Moves a coordinate by the whole steps nearest to `steps`: exact, and so is the way back.
void move(float steps, float step, float& coordinate, std::int8_t& moved) {
  const float whole = std::floor(std::clamp(steps, -127.0F, 127.0F) + 0.5F);
  moved = static_cast<std::int8_t>(whole);
  coordinate += whole * step;
}

}  // namespace

float TargetBlock::start_of(std::uint16_t triangle, float coarseness) const {
  return std::min(kInsetSteps * kStepShare * coarseness * triangles_[triangle].per_texel,
                  edges_[triangle].most);
}

Vec3f TargetBlock::way_inside(std::uint16_t triangle, Four beyond) const {
  const Edges& edges = edges_[triangle];
  const Affine& a = triangles_[triangle];
  // For each edge that is too near, along its inward normal by what is lacking. Near a corner the
  // ways of two edges add up.
  float x = 0, y = 0;  // into the triangle, in texels
  for (int k = 0; k < 3; ++k) {
    const float lacking = std::max(-beyond[k], 0.0F);
    x += edges.x[k] * lacking;
    y += edges.y[k] * lacking;
  }
  return a.pu * x + a.pv * y;
}

/// Moves the start of a ray that is nearer to an edge of its owner than the inset away from it.
void TargetBlock::move_start(std::size_t lane, Four beyond, TexelPacket& packet) const {
  const float step = step_of(packet);
  const Vec3f way = way_inside(owner_[packet.texel[lane]], beyond) * (1 / step);
  if (!std::isfinite(way.x + way.y + way.z)) return;  // no area in the image to speak of
  move(way.x, step, packet.px[lane], packet.inset_x[lane]);
  move(way.y, step, packet.py[lane], packet.inset_y[lane]);
  move(way.z, step, packet.pz[lane], packet.inset_z[lane]);
  packet.is_inset = true;
}

void TargetBlock::fill(const std::uint16_t* texels, std::size_t count, bool is_deep,
                       TexelPacket& packet) const {
  if (has_records()) return fill_records(texels, count, packet);
  // One coarseness for all lanes, that of the coarsest owner: kernels compare sixteen keys at once.
  if (is_deep && is_of_one(texels, count)) {
    packet.coarseness = triangles_[owner_[texels[0]]].coarseness;
    fill_deep(texels, count, packet);
    return make_unit(packet);
  }
  // Four lanes at once: each one's point and normal as vectors of x, y, z and something, which are
  // then turned over.
  constexpr std::size_t kFour = 4;
  float coarseness = 0;
  for (std::size_t first = 0; first < kLanes; first += kFour) {
    std::array<Four, kFour> points, normals;
    for (std::size_t i = 0; i < kFour; ++i) {
      const std::size_t lane = first + i;
      // Unused lanes repeat lane 0's start, so they widen no bound, with a zero normal, which faces
      // nothing.
      const std::uint16_t at = texels[lane < count ? lane : 0];
      const Affine& a = triangles_[owner_[at]];
      const float dx = static_cast<float>(at % mesh::kBlockEdge) - a.x;
      const float dy = static_cast<float>(at / mesh::kBlockEdge) - a.y;
      points[i] = a.four(&Affine::p) + (a.four(&Affine::pu) * dx + a.four(&Affine::pv) * dy);
      normals[i] = a.four(&Affine::n) + (a.four(&Affine::nu) * dx + a.four(&Affine::nv) * dy);
      packet.per_texel[lane] = a.per_texel;
      packet.texel[lane] = lane < count ? at : kNoTexel;
      packet.owner[lane] = owner_[at];
      coarseness = std::max(coarseness, a.coarseness);
    }
    turn_over(points, packet.px + first, packet.py + first, packet.pz + first);
    turn_over(normals, packet.nx + first, packet.ny + first, packet.nz + first);
  }
  for (std::size_t lane = count; lane < kLanes; ++lane)
    packet.nx[lane] = packet.ny[lane] = packet.nz[lane] = 0;
  packet.coarseness = coarseness;
  if (!is_deep) move_starts(count, packet);
  make_unit(packet);
}

/// Of rays that start nearer to an edge of their owner than the inset.
void TargetBlock::move_starts(std::size_t count, TexelPacket& packet) const {
  for (std::size_t lane = 0; lane < count; ++lane) {
    const std::uint16_t owner = packet.owner[lane], at = packet.texel[lane];
    const Affine& a = triangles_[owner];
    const float dx = static_cast<float>(at % mesh::kBlockEdge) - a.x;
    const float dy = static_cast<float>(at / mesh::kBlockEdge) - a.y;
    const Four beyond = edges_[owner].beyond(dx, dy, start_of(owner, packet.coarseness));
    if (any_negative(beyond)) move_start(lane, beyond, packet);
  }
  for (std::size_t lane = count; lane < kLanes; ++lane) {  // where lane 0 starts
    packet.px[lane] = packet.px[0];
    packet.py[lane] = packet.py[0];
    packet.pz[lane] = packet.pz[0];
  }
}

bool TargetBlock::is_of_one(const std::uint16_t* texels, std::size_t count) const {
  return std::all_of(texels, texels + count,
                     [&](std::uint16_t texel) { return owner_[texel] == owner_[texels[0]]; });
}

/// The same of texels deep inside of one triangle, in loops that become vectors.
void TargetBlock::fill_deep(const std::uint16_t* texels, std::size_t count,
                            TexelPacket& packet) const {
  const std::uint16_t owner = owner_[texels[0]];
  const Affine a = triangles_[owner];
  float dx[kLanes], dy[kLanes];
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const bool used = lane < count;
    const std::uint32_t at = texels[used ? lane : 0];
    dx[lane] = static_cast<float>(at % mesh::kBlockEdge) - a.x;
    dy[lane] = static_cast<float>(at / mesh::kBlockEdge) - a.y;
    packet.texel[lane] = used ? texels[lane] : kNoTexel;
    packet.owner[lane] = owner;
    packet.per_texel[lane] = a.per_texel;
  }
  const auto put = [&](float at, float along_x, float along_y, float(&out)[kLanes]) {
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      out[lane] = at + (along_x * dx[lane] + along_y * dy[lane]);
  };
  put(a.p.x, a.pu.x, a.pv.x, packet.px);
  put(a.p.y, a.pu.y, a.pv.y, packet.py);
  put(a.p.z, a.pu.z, a.pv.z, packet.pz);
  put(a.n.x, a.nu.x, a.nv.x, packet.nx);
  put(a.n.y, a.nu.y, a.nv.y, packet.ny);
  put(a.n.z, a.nu.z, a.nv.z, packet.nz);
  for (std::size_t lane = count; lane < kLanes; ++lane)
    packet.nx[lane] = packet.ny[lane] = packet.nz[lane] = 0;
}

/// Lane by lane as in texel(), in loops that become vectors.
void TargetBlock::make_unit(TexelPacket& packet) {
  float scale[kLanes];
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const float squared = packet.nx[lane] * packet.nx[lane] + packet.ny[lane] * packet.ny[lane] +
                          packet.nz[lane] * packet.nz[lane];
    scale[lane] = squared > 0 ? 1.0F / std::sqrt(squared) : 0.0F;
  }
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    packet.nx[lane] *= scale[lane];
    packet.ny[lane] *= scale[lane];
    packet.nz[lane] *= scale[lane];
  }
}

}  // namespace pounce::surface
