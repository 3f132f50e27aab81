// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <vector>

#include "projection/splat_blend.h"
#include "support/bytes.h"
#include "support/splat_scenes.h"

namespace pounce::test {

/// The splat kernels that this processor has.
inline std::vector<const projection::SplatKernels*> available_splat_kernels() {
  std::vector<const projection::SplatKernels*> all;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    const projection::SplatKernels* found = nullptr;
    if (error_kind([&] { found = &projection::splat_kernels(isa); }) == 0) all.push_back(found);
  }
  return all;
}

/// Sixteen texels of a wavy surface near z = 0, 4x4 of edge `edge` from (x, y).
inline surface::TexelPacket wavy_packet(float x, float y, float edge, float lift, int used) {
  surface::TexelPacket packet{};
  for (int lane = 0; lane < surface::kLanes; ++lane) {
    const int at = lane < used ? lane : 0;
    const float px = x + static_cast<float>(at % 4) * edge,
                py = y + static_cast<float>(at / 4) * edge;
    packet.px[lane] = px;
    packet.py[lane] = py;
    packet.pz[lane] = lift + 0.01F * std::sin(5 * px);
    const Vec3f n{-0.05F * std::cos(5 * px), 0.03F, 1};
    const float scale = lane < used ? 1 / length(n) : 0;
    packet.nx[lane] = n.x * scale;
    packet.ny[lane] = n.y * scale;
    packet.nz[lane] = n.z * scale;
    packet.per_texel[lane] = 1 / edge;
    packet.texel[lane] = lane < used ? static_cast<std::uint16_t>(lane) : surface::kNoTexel;
  }
  return packet;
}

inline ReferenceTexel texel_of(const surface::TexelPacket& packet, int lane) {
  ReferenceTexel texel;
  texel.position = {packet.px[lane], packet.py[lane], packet.pz[lane]};
  texel.normal = {packet.nx[lane], packet.ny[lane], packet.nz[lane]};
  texel.normal = texel.normal * (1 / length(texel.normal));
  texel.edge = 1 / static_cast<double>(packet.per_texel[lane]);
  return texel;
}

/// Packets of one piece, two to a group.
inline projection::SplatState piece_of_packets(Random& random, std::size_t packets) {
  projection::SplatState state;
  for (std::uint32_t p = 0; p < packets; ++p) {
    const float edge = random.one_in(3) ? 0.02F : 0.006F;
    const int used = random.one_in(4) ? 5 : surface::kLanes;
    state.packets.push_back(wavy_packet(random.between(-1.0F, 0.9F), random.between(-1.0F, 0.9F),
                                        edge, random.between(-0.05F, 0.05F), used));
    if (p % 2 == 0) {
      state.groups.push_back({p, 1});
    } else {
      state.groups.back().count = 2;
    }
  }
  return state;
}

}  // namespace pounce::test
