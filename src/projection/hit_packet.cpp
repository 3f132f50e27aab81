// SPDX-License-Identifier: Apache-2.0
//
// Which build of the kernels runs, and the lists that they run over.
//
// One source is compiled per instruction set (kernels.cpp.in), each in a namespace of its own.
// Inline functions that two builds shared under one name would be merged by the linker, and a
// processor could meet instructions that it does not have. All builds give the same bits, so the
// choice shows in time only.
#include "projection/hit_packet.h"

#include <algorithm>
#include <cmath>

#include "core/instruction_set.h"

namespace pounce::projection {

namespace sse2 {
extern const Kernels kKernels;
}
namespace avx2 {
extern const Kernels kKernels;
}
namespace avx512 {
extern const Kernels kKernels;
}

const Kernels& kernels(const std::string& isa) {
  const std::string chosen = instruction_set(isa);
  return chosen == "avx512" ? avx512::kKernels : chosen == "avx2" ? avx2::kKernels : sse2::kKernels;
}

void clear(HitPacket& best) {
  std::fill(std::begin(best.key), std::end(best.key), kNoHit);
  std::fill(std::begin(best.id), std::end(best.id), kNoHit);
}

// --- bundles -------------------------------------------------------------------------------------
//
// A cone around sixteen rays, for culling: from p + t n, minus the axis o + t d, remain (p - o) + t
// (n - d). So no ray is farther from the axis at t than offset + |t| spread, the largest of both
// differences. A patch outside of that for all lanes is tested once instead of sixteen times. The
// bound may be loose, never too small: a patch culled by rounding would be a hole in the image, and
// a different one for other packets.

namespace {

Vec3f unit_or_zero(Vec3f v) {
  const float squared = dot(v, v);
  return squared > 1e-12F ? v * (1 / std::sqrt(squared)) : Vec3f{};
}

// Four partial results, which vectors can hold: a bundle is a bound, so the order of sums is free.

float sum_of(const float (&v)[kLanes]) {
  float part[4] = {v[0], v[1], v[2], v[3]};
  for (int i = 4; i < kLanes; i += 4) {
    for (int k = 0; k < 4; ++k) part[k] += v[i + k];
  }
  return (part[0] + part[1]) + (part[2] + part[3]);
}

/// Of what is not negative; what is no number does not count.
float largest_of(const float (&v)[kLanes]) {
  float part[4] = {};
  for (int i = 0; i < kLanes; i += 4) {
    for (int k = 0; k < 4; ++k) part[k] = std::max(part[k], v[i + k]);
  }
  return std::max(std::max(part[0], part[1]), std::max(part[2], part[3]));
}

/// The sum of what the used lanes have.
float sum_of(const float (&v)[kLanes], const float (&used)[kLanes]) {
  float products[kLanes];
  for (int i = 0; i < kLanes; ++i) products[i] = used[i] * v[i];
  return sum_of(products);
}

}  // namespace

RayBundle bundle_of(const surface::TexelPacket& packet) {
  RayBundle bundle;
  // Unused lanes repeat the first one's point and have no normal.
  float used[kLanes];
  for (int i = 0; i < kLanes; ++i) used[i] = packet.texel[i] == surface::kNoTexel ? 0.0F : 1.0F;
  const Vec3f points{sum_of(packet.px, used), sum_of(packet.py, used), sum_of(packet.pz, used)};
  bundle.origin = points * (1 / sum_of(used));
  // Zero where normals cancel out. Then spread is 1, and the cone a ball that grows with the
  // height.
  bundle.direction = unit_or_zero({sum_of(packet.nx), sum_of(packet.ny), sum_of(packet.nz)});
  float offsets[kLanes], spreads[kLanes], sizes[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const float x = packet.px[i] - bundle.origin.x, y = packet.py[i] - bundle.origin.y,
                z = packet.pz[i] - bundle.origin.z;
    const float u = packet.nx[i] - bundle.direction.x, v = packet.ny[i] - bundle.direction.y,
                w = packet.nz[i] - bundle.direction.z;
    offsets[i] = x * x + y * y + z * z;
    spreads[i] = used[i] * (u * u + v * v + w * w);
    sizes[i] = std::abs(packet.px[i]) + std::abs(packet.py[i]) + std::abs(packet.pz[i]);
  }
  const float offset = largest_of(offsets), spread = largest_of(spreads),
              largest = largest_of(sizes);
  // Coordinates are floats: a few of their last places cover every rounding on the way to a hit.
  bundle.offset = std::sqrt(offset) * 1.00001F + 4e-7F * largest;
  bundle.spread = std::sqrt(spread) * 1.00001F + 4e-7F;
  return bundle;
}

RayBundle unite(std::span<const RayBundle> bundles) {
  RayBundle all;
  // Margins of coordinates are in each bundle's offset already; here only the sums round.
  Vec3f directions;
  for (const RayBundle& b : bundles) {
    all.origin = all.origin + b.origin;
    directions = directions + b.direction;
  }
  all.origin = all.origin * (1 / static_cast<float>(bundles.size()));
  all.direction = unit_or_zero(directions);
  for (const RayBundle& b : bundles) {
    all.offset = std::max(all.offset, (length(b.origin - all.origin) + b.offset) * 1.00001F);
    all.spread = std::max(all.spread, (length(b.direction - all.direction) + b.spread) * 1.00001F);
  }
  return all;
}

}  // namespace pounce::projection
