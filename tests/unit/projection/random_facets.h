// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "projection/hit_packet.h"
#include "support/random.h"
#include "surface/source_block.h"

namespace pounce::test {

inline Vec3f random_vec(Random& random, float size) {
  return {random.between(-size, size), random.between(-size, size), random.between(-size, size)};
}

inline Vec3f random_direction(Random& random) {
  for (;;) {
    const Vec3f v = random_vec(random, 1);
    if (length(v) > 0.1F && length(v) <= 1) return v * (1 / length(v));
  }
}

/// `count` triangles of edges up to `size` near the unit cube, as a source block makes them. Texels
/// of a 64x64 image, so that some are cut and some whole.
inline surface::SourceBlock random_source(Random& random, int count, float size,
                                          std::uint32_t first_id = 0) {
  store::GeometryBlock block;
  for (int i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint16_t>(block.positions.size());
    const Vec3f at = random_vec(random, 1);
    const Vec3f normal = random_direction(random);
    const float bend = random.one_in(2) ? 0.0F : random.between(0.0F, 1.5F);
    // All in the block's window, so that a cut triangle loses nothing.
    const float u = random.between(0.1F, 0.6F), v = random.between(0.1F, 0.6F);
    const float texels = random.one_in(2) ? 0.3F : 0.02F;
    for (std::uint16_t k = 0; k < 3; ++k) {
      block.positions.push_back(at + random_vec(random, size));
      const Vec3f bent = normal + random_vec(random, bend);
      block.normals.push_back(bent * (1 / length(bent)));
      block.uvs.push_back({u + random.between(0.0F, texels), v + random.between(0.0F, texels)});
      block.tangents.push_back({});
    }
    block.triangles.push_back(
        {first, static_cast<std::uint16_t>(first + 1), static_cast<std::uint16_t>(first + 2)});
    block.ids.push_back(first_id + static_cast<std::uint32_t>(i));
  }
  return surface::make_source_block(block, {64, 64, 0, {}});
}

/// Sixteen texels (or fewer) that lie together and face about one way.
inline surface::TexelPacket random_packet(Random& random, float size) {
  surface::TexelPacket packet{};
  const Vec3f at = random_vec(random, 1), facing = random_direction(random);
  const int used = random.one_in(4) ? static_cast<int>(1 + random.below(16)) : 16;
  const float edge = random.between(0.005F, 0.05F);
  for (int lane = 0; lane < surface::kLanes; ++lane) {
    const Vec3f n = facing + random_vec(random, 0.3F);
    const Vec3f p = at + random_vec(random, size);
    const bool is_used = lane < used;
    const Vec3f normal = is_used ? n * (1 / length(n)) : Vec3f{};
    packet.px[lane] = is_used ? p.x : packet.px[0];
    packet.py[lane] = is_used ? p.y : packet.py[0];
    packet.pz[lane] = is_used ? p.z : packet.pz[0];
    packet.nx[lane] = normal.x;
    packet.ny[lane] = normal.y;
    packet.nz[lane] = normal.z;
    packet.per_texel[lane] = is_used ? 1 / edge : 1;
    packet.texel[lane] = is_used ? static_cast<std::uint16_t>(lane) : surface::kNoTexel;
  }
  packet.is_inset = random.one_in(2);
  for (int lane = 0; lane < surface::kLanes && packet.is_inset; ++lane) {
    packet.inset_x[lane] = static_cast<std::int8_t>(random.whole(-64, 64));
    packet.inset_y[lane] = static_cast<std::int8_t>(random.whole(-64, 64));
    packet.inset_z[lane] = static_cast<std::int8_t>(random.whole(-64, 64));
  }
  return packet;
}

}  // namespace pounce::test
