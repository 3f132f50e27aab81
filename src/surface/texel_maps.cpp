// SPDX-License-Identifier: Apache-2.0
//
// Maps of a dense target: stored texel by texel, rounded so that nobody can tell.
//
// Positions count in whole steps from the origin. A step is a power of two, so that a position, and
// one that was moved by whole steps, is an exact float: the search and the kernels work on with it
// as with any other. It is between 1/4096 and 1/2048 of the block's smallest texel, but not finer
// than what a hit's arithmetic can tell apart where the block is (step_of(), four last places of
// its largest coordinate):
//
//   a position is off by at most 0.87 steps     < 1/2000 of a texel, or < 4 last places
//   the image is read off by as much            an 8-bit sample on its own texel stays as it is
//   rays start 32 steps inside of their owner   so it still wins, on an edge and rounded
//                                               (decision 15)
//
// Where a triangle far out makes the steps too coarse for a small one that shares its block, the
// block keeps its triangles. Normals are off by at most 7e-5: over a ray of 100 texels, 1/140 of
// one.
#include <algorithm>
#include <bit>
#include <cmath>

#include "surface/target_block.h"

namespace pounce::surface {
namespace {

constexpr float kPerTexel = 2048;   // steps of the smallest texel, at least
constexpr float kFewest = 256;      // of any texel, where single precision is coarser than that
constexpr float kCoarsest = 4;      // times what is told apart at a texel's own triangle
constexpr float kNoEdge = 1e-30F;   // as_records() is asked of maps without a bound
constexpr double kMostMoved = 127;  // steps, in 8 bits

std::int32_t steps(float coordinate, float per_step) {
  return static_cast<std::int32_t>(std::floor(coordinate * per_step + 0.5F));
}

/// The upper half of a positive float, rounded.
std::uint16_t upper_half(float v) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(v) + 0x8000U;
  return static_cast<std::uint16_t>(std::clamp(bits >> 16, 1U, 0x7F7FU));
}

float from_upper_half(std::uint16_t half) {
  return std::bit_cast<float>(std::uint32_t{half} << 16);
}

}  // namespace

/// 0 where no step will do.
float TargetBlock::record_step() const {
  std::vector<bool> owns(triangles_.size());
  for (const std::uint16_t o : owner_) {
    if (o != store::kNoTriangle) owns[o] = true;
  }
  float largest = 0, densest = 0;
  for (std::size_t i = 0; i < owns.size(); ++i) {
    if (!owns[i]) continue;
    largest = std::max(largest, triangles_[i].coarseness);
    // Triangles without area in space have no texels to speak of.
    if (triangles_[i].per_texel * kNoEdge < 1) densest = std::max(densest, triangles_[i].per_texel);
  }
  float step = largest * kStepShare;
  if (densest > 0) step = std::max(step, std::ldexp(1.0F, std::ilogb(1 / (kPerTexel * densest))));
  for (std::size_t i = 0; i < owns.size(); ++i) {
    const Affine& a = triangles_[i];
    const float fine = std::max(kCoarsest * kStepShare * a.coarseness, 1 / (kFewest * a.per_texel));
    if (owns[i] && !(step <= fine)) return 0;
  }
  return step >= store::kSmallestStep && step <= store::kLargestStep ? step : 0;
}

store::TexelRecord TargetBlock::record(std::uint32_t texel, float step) const {
  const std::uint16_t owner = owner_[texel];
  const Affine& a = triangles_[owner];
  const Texel exact = this->texel(texel);
  const float per_step = 1 / step;
  const Four beyond = edges_[owner].beyond(static_cast<float>(texel % mesh::kBlockEdge) - a.x,
                                           static_cast<float>(texel / mesh::kBlockEdge) - a.y,
                                           start_of(owner, step / kStepShare));
  Vec3f start = exact.position + way_inside(owner, beyond);
  if (!std::isfinite(start.x + start.y + start.z)) start = exact.position;
  store::TexelRecord out;
  const float own[3] = {exact.position.x, exact.position.y, exact.position.z};
  const float moved[3] = {start.x, start.y, start.z};
  for (std::size_t k = 0; k < 3; ++k) {
    out.position[k] = steps(own[k], per_step);
    const double way = static_cast<double>(steps(moved[k], per_step)) - out.position[k];
    out.inset[k] = static_cast<std::int8_t>(std::clamp(way, -kMostMoved, kMostMoved));
  }
  out.normal = to_octahedral(exact.normal);
  out.edge = upper_half(1 / a.per_texel);
  return out;
}

std::optional<store::GeometryBlock> TargetBlock::as_records(
    const store::GeometryBlock& block) const {
  const float step = record_step();
  if (step == 0) return std::nullopt;
  store::GeometryBlock out;
  out.page = block.page;
  out.x = block.x;
  out.y = block.y;
  out.step = step;
  out.owner = owner_;
  for (std::uint32_t t = 0; t < store::kTexelsPerBlock; ++t) {
    if (!covered(t)) continue;
    const Vec3f p = position(t) * (1 / step);
    constexpr float kMost = store::kLargestPosition / 2;  // half: starts lie elsewhere
    if (!(std::abs(p.x) <= kMost && std::abs(p.y) <= kMost && std::abs(p.z) <= kMost))
      return std::nullopt;
    out.owner[t] = static_cast<std::uint16_t>(out.records.size());
    out.records.push_back(record(t, step));
  }
  return out;
}

void TargetBlock::read_records(const store::GeometryBlock& block, float smallest_edge,
                               Start start) {
  records_coarseness_ = block.step / kStepShare;
  records_are_inset_ = start == Start::inset;
  records_.resize(block.records.size());
  for (std::size_t i = 0; i < records_.size(); ++i) {
    const store::TexelRecord& record = block.records[i];
    RecordTexel& out = records_[i];
    out.map.position = {static_cast<float>(record.position[0]) * block.step,
                        static_cast<float>(record.position[1]) * block.step,
                        static_cast<float>(record.position[2]) * block.step};
    out.map.normal = from_octahedral(record.normal);
    out.map.per_texel = 1.0F / std::max(from_upper_half(record.edge), smallest_edge);
    out.inset = record.inset;
  }
}

void TargetBlock::fill_records(const std::uint16_t* texels, std::size_t count,
                               TexelPacket& packet) const {
  packet.coarseness = records_coarseness_;
  const float step = records_are_inset_ ? step_of(packet) : 0;
  int any = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const bool used = lane < count;
    const RecordTexel& r = records_[owner_[texels[used ? lane : 0]]];
    packet.px[lane] = r.map.position.x + static_cast<float>(r.inset[0]) * step;
    packet.py[lane] = r.map.position.y + static_cast<float>(r.inset[1]) * step;
    packet.pz[lane] = r.map.position.z + static_cast<float>(r.inset[2]) * step;
    packet.nx[lane] = used ? r.map.normal.x : 0;
    packet.ny[lane] = used ? r.map.normal.y : 0;
    packet.nz[lane] = used ? r.map.normal.z : 0;
    packet.per_texel[lane] = r.map.per_texel;
    packet.texel[lane] = used ? texels[lane] : kNoTexel;
    packet.owner[lane] = owner_[texels[used ? lane : 0]];
    packet.inset_x[lane] = used ? r.inset[0] : std::int8_t{0};
    packet.inset_y[lane] = used ? r.inset[1] : std::int8_t{0};
    packet.inset_z[lane] = used ? r.inset[2] : std::int8_t{0};
    any |= r.inset[0] | r.inset[1] | r.inset[2];
  }
  packet.is_inset = records_are_inset_ && any != 0;
}

}  // namespace pounce::surface
