// SPDX-License-Identifier: Apache-2.0
//
// A cone around sixteen rays, for culling: from p + t n, minus the axis o + t d, remain (p - o) + t
// (n - d). So no ray is farther from the axis at t than offset + |t| spread, the largest of both
// differences. A patch outside of that for all lanes is tested once instead of sixteen times. The
// bound may be loose, never too small: a patch culled by rounding would be a hole in the image, and
// a different one for other packets.
#include "projection/packet_bundle.h"

#include <algorithm>
#include <cmath>

namespace pounce::projection {
namespace {

Vec3f unit_or_zero(Vec3f v) {
  const float squared = dot(v, v);
  return squared > 1e-12F ? v * (1 / std::sqrt(squared)) : Vec3f{};
}

}  // namespace

RayBundle bundle_of(const surface::TexelPacket& packet) {
  constexpr int kLanes = surface::kLanes;
  RayBundle bundle;
  Vec3f normals;
  float count = 0, largest = 0;
  for (int i = 0; i < kLanes;
       ++i) {  // unused lanes repeat the first one's point and have no normal
    const float used = packet.texel[i] == surface::kNoTexel ? 0.0F : 1.0F;
    bundle.origin.x += used * packet.px[i];
    bundle.origin.y += used * packet.py[i];
    bundle.origin.z += used * packet.pz[i];
    normals.x += packet.nx[i];
    normals.y += packet.ny[i];
    normals.z += packet.nz[i];
    count += used;
  }
  bundle.origin = bundle.origin * (1 / count);
  // Zero where normals cancel out. Then spread is 1, and the cone a ball that grows with the
  // height.
  bundle.direction = unit_or_zero(normals);
  float offsets[kLanes], spreads[kLanes], sizes[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const float used = packet.texel[i] == surface::kNoTexel ? 0.0F : 1.0F;
    const float x = packet.px[i] - bundle.origin.x, y = packet.py[i] - bundle.origin.y,
                z = packet.pz[i] - bundle.origin.z;
    const float u = packet.nx[i] - bundle.direction.x, v = packet.ny[i] - bundle.direction.y,
                w = packet.nz[i] - bundle.direction.z;
    offsets[i] = x * x + y * y + z * z;
    spreads[i] = used * (u * u + v * v + w * w);
    sizes[i] = std::abs(packet.px[i]) + std::abs(packet.py[i]) + std::abs(packet.pz[i]);
  }
  float offset = 0, spread = 0;
  for (int i = 0; i < kLanes; ++i) {
    offset = std::max(offset, offsets[i]);
    spread = std::max(spread, spreads[i]);
    largest = std::max(largest, sizes[i]);
  }
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
