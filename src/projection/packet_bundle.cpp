// SPDX-License-Identifier: Apache-2.0
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

RayBundle bundle_of(const target::TexelPacket& packet) {
  RayBundle bundle;
  Vec3f normals;
  float count = 0, largest = 0;
  for (int i = 0; i < target::kLanes; ++i) {
    if (packet.texel[i] == target::kNoTexel) continue;
    bundle.origin = bundle.origin + Vec3f{packet.px[i], packet.py[i], packet.pz[i]};
    normals = normals + Vec3f{packet.nx[i], packet.ny[i], packet.nz[i]};
    largest =
        std::max({largest, std::abs(packet.px[i]), std::abs(packet.py[i]), std::abs(packet.pz[i])});
    ++count;
  }
  bundle.origin = bundle.origin * (1 / count);
  bundle.direction = unit_or_zero(normals);
  float offset = 0, spread = 0;  // squared
  for (int i = 0; i < target::kLanes; ++i) {
    if (packet.texel[i] == target::kNoTexel) continue;
    const Vec3f p = Vec3f{packet.px[i], packet.py[i], packet.pz[i]} - bundle.origin;
    const Vec3f n = Vec3f{packet.nx[i], packet.ny[i], packet.nz[i]} - bundle.direction;
    offset = std::max(offset, dot(p, p));
    spread = std::max(spread, dot(n, n));
  }
  // Coordinates are floats: a few of their last places cover every rounding on the way to a hit.
  bundle.offset = std::sqrt(offset) * 1.00001F + 4e-7F * largest;
  bundle.spread = std::sqrt(spread) * 1.00001F + 4e-7F;
  return bundle;
}

RayBundle unite(std::span<const RayBundle> bundles) {
  RayBundle all;
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
