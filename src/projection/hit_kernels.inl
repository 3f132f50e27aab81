// SPDX-License-Identifier: Apache-2.0
//
// The hit test, compiled once per instruction set with POUNCE_ISA_NAMESPACE set.
//
// Lanes are sixteen target texels; the facet is broadcast. Per lane, in the texel's own ray p + t
// n:
//
//   t = N . (m - p) / (N . n)           where the ray meets the facet's plane
//   d = p + t n - m                     the hit, from corner 0
//   w1 = g1 . d, w2 = g2 . d            barycentrics of corners 1 and 2
//   outside = |d - nearest(w1, w2)|     0 inside the triangle; nearest() clamps the barycentrics
//   into it key = (|t| + outside) / texel       the winner has the least (key, triangle)
//
// and the winner's texel coordinates, affine in the clamped barycentrics. Vectors are GCC vector
// extensions of sixteen lanes that the compiler lowers to whatever registers the instruction set
// has.
#include <immintrin.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "projection/hit_packet.h"

namespace pounce::projection::POUNCE_ISA_NAMESPACE {
namespace {

using Floats = float __attribute__((vector_size(64)));
using Ints = std::int32_t __attribute__((vector_size(64)));

inline Floats load(const float* at) {
  Floats v;
  std::memcpy(&v, at, sizeof v);
  return v;
}
inline Ints load(const std::int32_t* at) {
  Ints v;
  std::memcpy(&v, at, sizeof v);
  return v;
}
template <class V, class T>
inline void store(T* at, V v) {
  std::memcpy(at, &v, sizeof v);
}
/// One bit per lane of a comparison's result.
inline unsigned bits(Ints mask) {
#if defined(__AVX512DQ__)
  return _mm512_movepi32_mask(reinterpret_cast<__m512i>(mask));
#elif defined(__AVX2__)
  __m256 halves[2];
  std::memcpy(halves, &mask, sizeof mask);
  return static_cast<unsigned>(_mm256_movemask_ps(halves[0]) | _mm256_movemask_ps(halves[1]) << 8);
#else
  __m128 quarters[4];
  std::memcpy(quarters, &mask, sizeof mask);
  return static_cast<unsigned>(_mm_movemask_ps(quarters[0]) | _mm_movemask_ps(quarters[1]) << 4 |
                               _mm_movemask_ps(quarters[2]) << 8 |
                               _mm_movemask_ps(quarters[3]) << 12);
#endif
}
inline bool any(Ints mask) { return bits(mask) != 0; }
inline Floats max0(Floats v) { return v > 0.0F ? v : Floats{}; }

void hit(const source::Facet& f, const TexelPacket& packet, const SearchLimits& limits,
         HitPacket& best) {
  const Floats nx = load(packet.nx), ny = load(packet.ny), nz = load(packet.nz);
  const Floats facing = f.n[0] * nx + f.n[1] * ny + f.n[2] * nz;
  Ints ok = facing >= limits.min_cosine;
  if (!any(ok)) return;

  const Floats rx = f.m[0] - load(packet.px), ry = f.m[1] - load(packet.py),
               rz = f.m[2] - load(packet.pz);
  const Floats t = (f.n[0] * rx + f.n[1] * ry + f.n[2] * rz) / facing;
  const Floats distance = t < 0.0F ? -t : t;
  const Floats dx = t * nx - rx, dy = t * ny - ry, dz = t * nz - rz;
  const Floats w1 = f.g1[0] * dx + f.g1[1] * dy + f.g1[2] * dz;
  const Floats w2 = f.g2[0] * dx + f.g2[1] * dy + f.g2[2] * dz;
  const Floats w0 = 1.0F - w1 - w2;
  ok &= (distance <= limits.max_distance) & (w0 >= -f.reach[0]) & (w1 >= -f.reach[1]) &
        (w2 >= -f.reach[2]);
  if (!any(ok)) return;

  Floats c1 = max0(w1), c2 = max0(w2);
  const Floats sum = c1 + c2;
  const Floats scale = 1.0F / (sum > 1.0F ? sum : Floats{} + 1.0F);
  c1 *= scale;
  c2 *= scale;
  const Floats ox = dx - (f.e1[0] * c1 + f.e2[0] * c2);
  const Floats oy = dy - (f.e1[1] * c1 + f.e2[1] * c2);
  const Floats oz = dz - (f.e1[2] * c1 + f.e2[2] * c2);
  const Floats squared = ox * ox + oy * oy + oz * oz;
  Floats outside;
  for (int lane = 0; lane < kLanes; ++lane) outside[lane] = __builtin_sqrtf(squared[lane]);
  ok &= outside <= f.tolerance;

  Floats key = (distance + outside) * load(packet.per_texel) * kKeySteps;
  key = (ok & (key < 1e9F)) ? key
                            : Floats{} + 1e9F;  // also keeps NaN and infinity out of the conversion
  const Ints quantised = __builtin_convertvector(key, Ints);
  const Ints old_key = load(best.key), old_id = load(best.id);
  const Ints better = ok & ((quantised < old_key) | ((quantised == old_key) & (f.id < old_id)));
  if (!any(better)) return;

  const Ints zero{};
  store(best.key, better ? quantised : old_key);
  store(best.id, better ? zero + f.id : old_id);
  store(best.page, better ? zero + f.page : load(best.page));
  store(best.base_x, better ? zero + f.base[0] : load(best.base_x));
  store(best.base_y, better ? zero + f.base[1] : load(best.base_y));
  const Floats x = f.frac[0] + (f.du[0] * c1 + f.du[1] * c2);
  const Floats y = f.frac[1] + (f.dv[0] * c1 + f.dv[1] * c2);
  store(best.frac_x, better ? x : load(best.frac_x));
  store(best.frac_y, better ? y : load(best.frac_y));
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
    Floats along = vx * d.x + vy * d.y + vz * d.z;
    along = along < 0.0F ? -along : along;
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
  Floats limit = height * load(packet.per_texel) * kKeySteps;
  limit = limit < 1e9F ? limit : Floats{} + 1e9F;
  const Ints open = load(best.key) >= __builtin_convertvector(limit, Ints);
  for (unsigned left = bits(open); left != 0; left &= left - 1) {
    if (packet.texel[std::countr_zero(left)] != target::kNoTexel) return false;
  }
  return true;
}

}  // namespace

extern const Kernels kKernels;
const Kernels kKernels{POUNCE_ISA_NAME, hit, search, all_final};

}  // namespace pounce::projection::POUNCE_ISA_NAMESPACE
