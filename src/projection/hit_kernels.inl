// SPDX-License-Identifier: Apache-2.0
//
// The hit test, compiled once per instruction set with POUNCE_ISA_NAMESPACE set.
//
// Lanes (lanes.inl) are sixteen target texels; the facet is broadcast. In each texel's own ray
// p + t n:
//
//   t = N . (m - p) / (N . n)         where the ray meets the facet's plane
//   d = p + t n - m                   the hit, from corner 0
//   w1 = g1 . d, w2 = g2 . d          barycentrics of corners 1 and 2
//   outside = |d - inside(w1, w2)|    inside() clamps the barycentrics into the triangle
//   key = (|t| + outside) / texel     the winner has the least (key, triangle)
//
// A hit counts while its key is below that of the distance limit: the winner of a texel is the same
// for every limit that lets anything through.
//
// and the winner's texel coordinates, affine in the clamped barycentrics.
#include <immintrin.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "projection/hit_packet.h"

namespace pounce::projection::POUNCE_ISA_NAMESPACE {
namespace {

#include "projection/lanes.inl"

/// The quantised key of hits at `distance`.
Ints key_limit(const TexelPacket& packet, float distance) {
  const Floats limit = distance * load(packet.per_texel) * kKeySteps;
  return to_int(select(limit < 1e9F, limit, all(1e9F)));
}

void hit(const source::Facet& f, const TexelPacket& packet, const SearchLimits& limits,
         HitPacket& best) {
  const Floats nx = load(packet.nx), ny = load(packet.ny), nz = load(packet.nz);
  const Floats facing = f.n[0] * nx + f.n[1] * ny + f.n[2] * nz;
  Ints ok = facing >= limits.min_cosine;
  if (!any(ok)) return;

  const Floats rx = f.m[0] - load(packet.px), ry = f.m[1] - load(packet.py),
               rz = f.m[2] - load(packet.pz);
  const Floats t = (f.n[0] * rx + f.n[1] * ry + f.n[2] * rz) / facing;
  const Floats distance = absolute(t);
  const Floats dx = t * nx - rx, dy = t * ny - ry, dz = t * nz - rz;
  const Floats w1 = f.g1[0] * dx + f.g1[1] * dy + f.g1[2] * dz;
  const Floats w2 = f.g2[0] * dx + f.g2[1] * dy + f.g2[2] * dz;
  const Floats w0 = 1.0F - w1 - w2;
  ok = ok & (distance <= limits.max_distance) & (w0 >= -f.reach[0]) & (w1 >= -f.reach[1]) &
       (w2 >= -f.reach[2]);
  if (!any(ok)) return;

  Floats c1 = select(w1 > 0.0F, w1, all(0.0F)), c2 = select(w2 > 0.0F, w2, all(0.0F));
  const Floats sum = c1 + c2;
  const Floats scale = 1.0F / select(sum > 1.0F, sum, all(1.0F));
  c1 = c1 * scale;
  c2 = c2 * scale;
  const Floats ox = dx - (f.e1[0] * c1 + f.e2[0] * c2);
  const Floats oy = dy - (f.e1[1] * c1 + f.e2[1] * c2);
  const Floats oz = dz - (f.e1[2] * c1 + f.e2[2] * c2);
  const Floats squared = ox * ox + oy * oy + oz * oz;
  const Floats outside = square_root(squared);
  ok = ok & (outside <= f.tolerance);

  Floats key = (distance + outside) * load(packet.per_texel) * kKeySteps;
  // The limit keeps NaN and infinity out of the conversion.
  key = select(ok & (key < 1e9F), key, all(1e9F));
  const Ints quantised = to_int(key);
  const Ints limit = key_limit(packet, limits.max_distance);
  ok = ok & ((quantised < limit) | (quantised == all(0)));
  const Ints old_key = load(best.key), old_id = load(best.id);
  const Ints better =
      ok & ((quantised < old_key) | ((quantised == old_key) & (all(f.id) < old_id)));
  if (!any(better)) return;

  store(best.key, select(better, quantised, old_key));
  store(best.id, select(better, all(f.id), old_id));
  store(best.page, select(better, all(f.page), load(best.page)));
  store(best.base_x, select(better, all(f.base[0]), load(best.base_x)));
  store(best.base_y, select(better, all(f.base[1]), load(best.base_y)));
  const Floats x = f.frac[0] + (f.du[0] * c1 + f.du[1] * c2);
  const Floats y = f.frac[1] + (f.dv[0] * c1 + f.dv[1] * c2);
  store(best.frac_x, select(better, x, load(best.frac_x)));
  store(best.frac_y, select(better, y, load(best.frac_y)));
}

/// RayBundle::may_meet for sixteen spheres.
void search(const Candidates& candidates, const RayBundle& bundle, float height,
            const TexelPacket& packet, const SearchLimits& limits, HitPacket& best) {
  const Vec3f o = bundle.origin, d = bundle.direction;
  const float reach_of_rays = bundle.offset + height * bundle.spread;
  for (std::size_t i = 0; i < candidates.size(); i += kLanes) {
    const Floats reach = (load(candidates.radius(i)) + reach_of_rays) * 1.00001F;
    const Floats vx = load(candidates.x(i)) - o.x, vy = load(candidates.y(i)) - o.y,
                 vz = load(candidates.z(i)) - o.z;
    const Floats cx = vy * d.z - vz * d.y, cy = vz * d.x - vx * d.z, cz = vx * d.y - vy * d.x;
    const Floats along = absolute(vx * d.x + vy * d.y + vz * d.z);
    const Ints meets = (cx * cx + cy * cy + cz * cz <= reach * reach) & (along <= height + reach);
    unsigned left = bits(meets);
    if (candidates.size() - i < kLanes) left &= (1U << (candidates.size() - i)) - 1;
    for (; left != 0; left &= left - 1) {
      hit(candidates.facet(i + static_cast<std::size_t>(std::countr_zero(left))), packet, limits,
          best);
    }
  }
}

bool all_final(const TexelPacket& packet, const HitPacket& best, float height) {
  const Ints open = load(best.key) >= key_limit(packet, height);
  for (unsigned left = bits(open); left != 0; left &= left - 1) {
    if (packet.texel[std::countr_zero(left)] != target::kNoTexel) return false;
  }
  return true;
}

}  // namespace

extern const Kernels kKernels;
const Kernels kKernels{POUNCE_ISA_NAME, hit, search, all_final};

}  // namespace pounce::projection::POUNCE_ISA_NAMESPACE
