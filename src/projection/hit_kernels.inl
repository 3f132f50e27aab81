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
//   s + s1 w1 + s2 w2                 the surface's normal there, which must face the texel's
//   |t| + outside                     the winner has the least (key of this, triangle); beside a
//                                     triangle it counts as a little more
//
// A hit counts while its key is below that of the distance limit: the winner of a texel is the same
// for every limit that lets anything through.
//
// A texel's ray starts a little inside of the triangle that owns it (TexelPacket), so that on an
// edge its own side wins by more than rounding; where the winner's image is read is said by the
// texel's own point, in coordinates affine in the clamped barycentrics.
#include <immintrin.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "projection/hit_packet.h"

namespace pounce::projection::POUNCE_ISA_NAMESPACE {
namespace {

#include "projection/lanes.inl"

/// A hit outside its triangle by more steps than this gives way to one that is inside and farther
/// away by so many (docs/decisions/041): on an edge rounding must not choose the triangle, whose
/// footprint the texel is averaged over.
constexpr float kBesideSteps = 0.25F, kBesideCosts = 4;

/// Where a packet's rays meet a facet's plane.
struct Meeting {
  Floats t, dx, dy, dz, w1, w2;
};

/// (rx, ry, rz) leads from the rays' starts to corner 0.
[[gnu::always_inline]] inline Meeting meet(const surface::Facet& f, const TexelPacket& packet,
                                           const Floats& rising, const Floats& rx, const Floats& ry,
                                           const Floats& rz) {
  Meeting out;
  out.t = (f.n[0] * rx + f.n[1] * ry + f.n[2] * rz) / rising;
  out.dx = out.t * load(packet.nx) - rx;
  out.dy = out.t * load(packet.ny) - ry;
  out.dz = out.t * load(packet.nz) - rz;
  out.w1 = f.g1[0] * out.dx + f.g1[1] * out.dy + f.g1[2] * out.dz;
  out.w2 = f.g2[0] * out.dx + f.g2[1] * out.dy + f.g2[2] * out.dz;
  return out;
}

/// Barycentrics 1 and 2 clamped into the triangle.
struct Inside {
  Floats c1, c2;
};
inline Inside inside(const Floats& w1, const Floats& w2) {
  const Floats c1 = select(w1 > 0.0F, w1, all(0.0F)), c2 = select(w2 > 0.0F, w2, all(0.0F));
  const Floats sum = c1 + c2;
  const Floats scale = 1.0F / select(sum > 1.0F, sum, all(1.0F));
  return {c1 * scale, c2 * scale};
}

/// Lanes that the surface faces where they hit it.
inline Ints faces(const surface::Facet& f, const TexelPacket& packet, const Inside& at,
                  float min_cosine) {
  const Floats sx = f.s[0] + (f.s1[0] * at.c1 + f.s2[0] * at.c2);
  const Floats sy = f.s[1] + (f.s1[1] * at.c1 + f.s2[1] * at.c2);
  const Floats sz = f.s[2] + (f.s1[2] * at.c1 + f.s2[2] * at.c2);
  const Floats along = sx * load(packet.nx) + sy * load(packet.ny) + sz * load(packet.nz);
  const Floats squared = sx * sx + sy * sy + sz * sz;
  // The least cosine is above zero, as is that of a zero normal below any.
  return (along > 0.0F) & (along * along >= min_cosine * min_cosine * squared);
}

/// Keeps a hit in the lanes of `better`, with the texel coordinates of the texels' own points.
inline void keep(const surface::Facet& f, const TexelPacket& packet, const Floats& rising,
                 Inside at, const Ints& better, const Ints& key, HitPacket& best) {
  if (packet.is_inset) {
    const float step = surface::step_of(packet);
    const Meeting own =
        meet(f, packet, rising, f.m[0] - (load(packet.px) - load(packet.inset_x) * step),
             f.m[1] - (load(packet.py) - load(packet.inset_y) * step),
             f.m[2] - (load(packet.pz) - load(packet.inset_z) * step));
    at = inside(own.w1, own.w2);
  }
  store(best.key, select(better, key, load(best.key)));
  store(best.id, select(better, all(f.id), load(best.id)));
  store(best.page, select(better, all(f.page), load(best.page)));
  store(best.base_x, select(better, all(f.base[0]), load(best.base_x)));
  store(best.base_y, select(better, all(f.base[1]), load(best.base_y)));
  const Floats x = f.frac[0] + (f.du[0] * at.c1 + f.du[1] * at.c2);
  const Floats y = f.frac[1] + (f.dv[0] * at.c1 + f.dv[1] * at.c2);
  store(best.frac_x, select(better, x, load(best.frac_x)));
  store(best.frac_y, select(better, y, load(best.frac_y)));
  for (int axis = 0; axis < 3; ++axis) {
    const float x_by = f.du[0] * f.g1[axis] + f.du[1] * f.g2[axis];
    const float y_by = f.dv[0] * f.g1[axis] + f.dv[1] * f.g2[axis];
    store(best.x_by[axis], select(better, all(x_by), load(best.x_by[axis])));
    store(best.y_by[axis], select(better, all(y_by), load(best.y_by[axis])));
  }
}

void hit(const surface::Facet& f, const TexelPacket& packet, const SearchLimits& limits,
         HitPacket& best) {
  const Floats nx = load(packet.nx), ny = load(packet.ny), nz = load(packet.nz);
  Floats rising = f.n[0] * nx + f.n[1] * ny + f.n[2] * nz;
  // Nothing of the surface can face a texel whose normal is farther than this from the plane's.
  const float least = limits.min_cosine - f.lean;
  Ints ok = rising >= least;
  if (!any(ok)) return;
  if (least < kGrazing) {
    const Floats bound = select(rising < 0.0F, all(-kGrazing), all(kGrazing));
    rising = select(absolute(rising) >= kGrazing, rising, bound);
  }

  const Meeting at = meet(f, packet, rising, f.m[0] - load(packet.px), f.m[1] - load(packet.py),
                          f.m[2] - load(packet.pz));
  const Floats distance = absolute(at.t);
  const Floats w0 = 1.0F - at.w1 - at.w2;
  ok = ok & (distance <= limits.max_distance) & (w0 >= -f.reach[0]) & (at.w1 >= -f.reach[1]) &
       (at.w2 >= -f.reach[2]);
  if (!any(ok)) return;

  const Inside in = inside(at.w1, at.w2);
  const Floats ox = at.dx - (f.e1[0] * in.c1 + f.e2[0] * in.c2);
  const Floats oy = at.dy - (f.e1[1] * in.c1 + f.e2[1] * in.c2);
  const Floats oz = at.dz - (f.e1[2] * in.c1 + f.e2[2] * in.c2);
  const Floats outside = square_root(ox * ox + oy * oy + oz * oz);
  const float step = surface::step_of(packet);
  const Floats beside = select(outside > kBesideSteps * step, all(kBesideCosts * step), all(0.0F));
  const Ints key = bits_of(distance + (outside + beside) + packet.coarseness);
  const Ints old_key = load(best.key);
  Ints better =
      ok & (outside <= f.tolerance) &
      ((key < all(key_of(limits.max_distance, packet))) | (key == all(key_of(0, packet)))) &
      ((key < old_key) | ((key == old_key) & (all(f.id) < load(best.id))));
  if (!any(better)) return;
  // Where the plane's normal leaves no doubt, the surface's need not be known.
  const float enough = limits.min_cosine + f.lean;
  if (any(better & (rising < (enough > 2 * kGrazing ? enough : 2 * kGrazing))))
    better = better & faces(f, packet, in, limits.min_cosine);
  if (any(better)) keep(f, packet, rising, in, better, key, best);
}

/// RayBundle::may_meet for sixteen spheres from the i-th: a bit each.
inline unsigned may_meet(const grid::PatchSpheres& spheres, std::size_t i, const RayBundle& bundle,
                         float height) {
  const Vec3f o = bundle.origin, d = bundle.direction;
  const Floats reach =
      (load(spheres.radius(i)) + bundle.offset + height * bundle.spread) * 1.00001F;
  const Floats vx = load(spheres.x(i)) - o.x, vy = load(spheres.y(i)) - o.y,
               vz = load(spheres.z(i)) - o.z;
  const Floats cx = vy * d.z - vz * d.y, cy = vz * d.x - vx * d.z, cz = vx * d.y - vy * d.x;
  const Floats along = absolute(vx * d.x + vy * d.y + vz * d.z);
  const Ints meets = (cx * cx + cy * cy + cz * cz <= reach * reach) & (along <= height + reach);
  unsigned met = bits(meets);
  if (spheres.size() - i < kLanes) met &= (1U << (spheres.size() - i)) - 1;
  return met;
}

std::size_t cull(const grid::PatchSpheres& list, const RayBundle& bundle, float height,
                 std::uint16_t* places) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < list.size(); i += kLanes) {
    for (unsigned met = may_meet(list, i, bundle, height); met != 0; met &= met - 1)
      places[count++] =
          static_cast<std::uint16_t>(i + static_cast<std::size_t>(std::countr_zero(met)));
  }
  return count;
}

void search(const grid::PatchSpheres& candidates, const RayBundle& bundle, float height,
            const TexelPacket& packet, const SearchLimits& limits, HitPacket& best) {
  for (std::size_t i = 0; i < candidates.size(); i += kLanes) {
    for (unsigned met = may_meet(candidates, i, bundle, height); met != 0; met &= met - 1) {
      hit(candidates.facet(i + static_cast<std::size_t>(std::countr_zero(met))), packet, limits,
          best);
    }
  }
}

bool all_final(const TexelPacket& packet, const HitPacket& best, float height) {
  const Ints open = load(best.key) >= all(key_of(height, packet));
  for (unsigned left = bits(open); left != 0; left &= left - 1) {
    if (packet.texel[std::countr_zero(left)] != surface::kNoTexel) return false;
  }
  return true;
}

}  // namespace

extern const Kernels kKernels;
const Kernels kKernels{POUNCE_ISA_NAME, hit, cull, search, all_final};

}  // namespace pounce::projection::POUNCE_ISA_NAMESPACE
