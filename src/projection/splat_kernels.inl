// SPDX-License-Identifier: Apache-2.0
//
// The response of Gaussians to texels, compiled once per instruction set with POUNCE_ISA_NAMESPACE
// set.
//
// Along the ray x + t n the largest response of a Gaussian (mean m, covariance S) is that of its 2D
// marginal in the plane across n, exp(-q / 2) with q = D' M^-1 D, M = T S T' + f I, D = T (m - x),
// where T spans the plane and f is the texel's footprint. It lies at the conditional mean t = n.(m
// - x) - (n' S T') M^-1 D. Neither a 3x3 inverse nor T is needed. With the Gaussian's axes a_k,
// variances s_k, u_k = a_k . n, d = m - x, v_k = a_k . (d x n) and g_k = s_k + f:
//
//   det M = u_0^2 g_1 g_2 + u_1^2 g_0 g_2 + u_2^2 g_0 g_1
//   q     = (g_0 v_0^2 + g_1 v_1^2 + g_2 v_2^2) / det M
//   t     = n.d - sum over cyclic (i, j, k) of u_i u_j (s_i - s_j) g_k v_k / det M
//
// The plain blend of a mesh's texels (add_met) is the same with f = 0 and other weights.
// (minors of M after Cauchy and Binet, and u_0^2 + u_1^2 + u_2^2 = 1). All terms of the first two
// are positive: nothing cancels, however thin a disc or a needle is. Lengths are in texel edges, so
// f is a constant and neither underflows.
#include <immintrin.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/sh_basis.h"
#include "projection/splat_packet.h"

namespace pounce::projection::POUNCE_ISA_NAMESPACE {
namespace {

#include "projection/lanes.inl"

using source::SplatShape;

/// exp(-x) for 0 <= x <= 4.5 to within 1e-6 of itself: a polynomial for exp(-x / 8), then its
/// eighth power. Multiplications and additions alone, so every machine agrees.
[[gnu::always_inline]] inline Floats exp_of_minus(const Floats& x) {
  const Floats y = x * 0.125F;  // <= 0.5625, where the polynomial is good to 5e-8
  Floats e = 0.040447037667F - 0.0063081225380F * y;
  e = e * y - 0.16631916165F;
  e = e * y + 0.49995476007F;
  e = e * y - 0.99999785423F;
  e = e * y + 1.0F;
  e = e * e;
  e = e * e;
  return e * e;
}

/// RayBundle::may_meet for sixteen spheres: a bit each.
unsigned meet(const float* x, const float* y, const float* z, const float* radius,
              const RayBundle& bundle, float height) {
  const Vec3f o = bundle.origin, d = bundle.direction;
  const Floats reach = (load(radius) + (bundle.offset + height * bundle.spread)) * 1.00001F;
  const Floats vx = load(x) - o.x, vy = load(y) - o.y, vz = load(z) - o.z;
  const Floats cx = vy * d.z - vz * d.y, cy = vz * d.x - vx * d.z, cz = vx * d.y - vy * d.x;
  const Floats along = absolute(vx * d.x + vy * d.y + vz * d.z);
  return bits((cx * cx + cy * cy + cz * cz <= reach * reach) & (along <= height + reach));
}

unsigned meet(const source::SplatSpheres& spheres, std::size_t i, const RayBundle& bundle,
              float height) {
  const unsigned found = meet(&spheres.centre[0][i], &spheres.centre[1][i], &spheres.centre[2][i],
                              &spheres.radius[i], bundle, height);
  const std::size_t left = spheres.count - i;
  return left < kLanes ? found & ((1U << left) - 1) : found;
}

void gather(const source::SplatSet& set, const RayBundle& bundle, float height,
            SplatCandidates& out) {
  for (std::size_t i = 0; i < set.levels[2].count; i += kLanes) {
    for (unsigned a = meet(set.levels[2], i, bundle, height); a != 0; a &= a - 1) {
      const std::size_t j = (i + static_cast<std::size_t>(std::countr_zero(a))) * kLanes;
      for (unsigned b = meet(set.levels[1], j, bundle, height); b != 0; b &= b - 1) {
        const std::size_t k = (j + static_cast<std::size_t>(std::countr_zero(b))) * kLanes;
        for (unsigned c = meet(set.levels[0], k, bundle, height); c != 0; c &= c - 1)
          out.add(set, k + static_cast<std::size_t>(std::countr_zero(c)));
      }
    }
  }
}

/// Texels as the formulas want them.
struct Rays {
  explicit Rays(const TexelPacket& packet)
      : px(load(packet.px)),
        py(load(packet.py)),
        pz(load(packet.pz)),
        nx(load(packet.nx)),
        ny(load(packet.ny)),
        nz(load(packet.nz)),
        per_texel(load(packet.per_texel)) {}
  Floats px, py, pz, nx, ny, nz, per_texel;
};

/// One Gaussian and sixteen texels; false if none of them gets anything. Without branches: what
/// passes is as good as random, and guessing wrong costs more than the rest of the formulas.
[[gnu::always_inline]] inline bool respond_to(const SplatShape& g, const Rays& ray,
                                              const SplatLimits& limits, SplatResponse& out) {
  const auto along_normal = [&](const float* a) {
    return a[0] * ray.nx + a[1] * ray.ny + a[2] * ray.nz;
  };
  Floats cosine = along_normal(g.normal);
  cosine = select(all(g.two_sided) > all(0), absolute(cosine), cosine);
  const Floats dx = (g.mean[0] - ray.px) * ray.per_texel, dy = (g.mean[1] - ray.py) * ray.per_texel,
               dz = (g.mean[2] - ray.pz) * ray.per_texel;
  const Floats mx = dy * ray.nz - dz * ray.ny, my = dz * ray.nx - dx * ray.nz,
               mz = dx * ray.ny - dy * ray.nx;
  const auto along_m = [&](const float* a) { return a[0] * mx + a[1] * my + a[2] * mz; };
  const Floats u0 = along_normal(g.axis[0]), u1 = along_normal(g.axis[1]),
               u2 = along_normal(g.axis[2]);
  const Floats v0 = along_m(g.axis[0]), v1 = along_m(g.axis[1]), v2 = along_m(g.axis[2]);
  const Floats scale = ray.per_texel * ray.per_texel;
  const Floats s0 = g.variance[0] * scale, s1 = g.variance[1] * scale, s2 = g.variance[2] * scale;
  const Floats g0 = s0 + kFootprint, g1 = s1 + kFootprint, g2 = s2 + kFootprint;
  const Floats uu0 = u0 * u0, uu1 = u1 * u1, uu2 = u2 * u2;
  const Floats det = uu0 * (g1 * g2) + uu1 * (g0 * g2) + uu2 * (g0 * g1);
  const Floats gv0 = g0 * v0, gv1 = g1 * v1, gv2 = g2 * v2;
  const Floats per_det = 1.0F / det;
  const Floats q = (gv0 * v0 + gv1 * v1 + gv2 * v2) * per_det;
  const Ints ok =
      (q <= source::kSplatCutOff * source::kSplatCutOff) & (cosine >= limits.min_cosine);
  const Floats bend =
      u0 * u1 * (s0 - s1) * gv2 + u1 * u2 * (s1 - s2) * gv0 + u2 * u0 * (s2 - s0) * gv1;
  const Floats depth = dx * ray.nx + dy * ray.ny + dz * ray.nz - bend * per_det;
  Floats weight = g.strength * (cosine * cosine);
  if (limits.antialiased) {
    const Floats bare = uu0 * (s1 * s2) + uu1 * (s0 * s2) + uu2 * (s0 * s1);
    weight = weight * square_root(bare * per_det);
  }
  weight = weight * exp_of_minus(select(ok, q, all(0.0F)) * 0.5F);
  store(out.weight, select(ok, weight, all(0.0F)));
  store(out.depth, select(ok, depth, all(0.0F)));
  out.shape = &g;
  return any(ok);
}

std::size_t respond(const SplatCandidates& candidates, std::size_t first, std::size_t last,
                    const RayBundle& bundle, float height, const TexelPacket& packet,
                    const SplatLimits& limits, SplatResponse* out) {
  const SplatShape* near[kMostResponses];
  std::size_t count = 0;
  for (std::size_t i = first; i < last; i += kLanes) {
    unsigned left = meet(candidates.x(i), candidates.y(i), candidates.z(i), candidates.radius(i),
                         bundle, height);
    if (last - i < kLanes) left &= (1U << (last - i)) - 1;
    for (; left != 0; left &= left - 1)
      near[count++] = &candidates.shape(i + static_cast<std::size_t>(std::countr_zero(left)));
  }
  const Rays rays(packet);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const bool keep = respond_to(*near[i], rays, limits, out[kept]);
    kept += keep ? 1 : 0;
  }
  return kept;
}

Floats to_float(const Ints& a) {
  return each([](IntRegister x) { return __builtin_convertvector(x, FloatRegister); }, a);
}

/// A weight is shared by the two bins around its depth: the profile follows the depth smoothly.
void deposit(std::span<const SplatResponse> responses, const DepthPacket& depths,
             ProfilePacket& profile) {
  const Floats per_width = load(depths.per_width);
  for (const SplatResponse& response : responses) {
    const Floats weight = load(response.weight) * kProfileSteps;
    const Floats at = load(response.depth) * per_width + static_cast<float>(kMiddleBin);
    const Ints inside = (at >= 0.0F) & (at < static_cast<float>(kProfileBins - 1));
    if (!any(inside)) continue;
    const Floats safe = select(inside, at, all(0.0F));
    const Floats given = select(inside, weight, all(0.0F));
    const Ints bin = to_int(safe);
    alignas(64) std::int32_t bins[kLanes], whole[kLanes], above[kLanes];
    store(bins, bin);
    store(whole, to_int(given + 0.5F));
    store(above, to_int(given * (safe - to_float(bin)) + 0.5F));
    for (int lane = 0; lane < kLanes; ++lane) {
      std::int32_t& low = profile.bins[bins[lane]][lane];
      std::int32_t& high = profile.bins[bins[lane] + 1][lane];
      // Clamped sums of what is never negative come out the same in any order.
      const std::int32_t l = low + (whole[lane] - above[lane]), h = high + above[lane];
      low = l < kFullBin ? l : kFullBin;
      high = h < kFullBin ? h : kFullBin;
    }
  }
}

// Half registers, because doubles are twice as wide.
constexpr int kHalf = kWidth / 2;
using HalfFloats = float __attribute__((vector_size(4 * kHalf)));
using DoubleRegister = double __attribute__((vector_size(8 * kHalf)));
using LongRegister = std::int64_t __attribute__((vector_size(8 * kHalf)));

/// Adds 0 <= value <= 8 in whole steps of 2^-36: a double of 2^52 and more has no fraction, so the
/// sum's low bits are the rounded steps.
void add_steps(const Floats& value, std::int64_t* sums) {
  constexpr double kNoFraction = 4503599627370496.0;  // 2^52
  const Floats steps = value * 68719476736.0F;        // 2^36, exact
  float at[kLanes];
  std::memcpy(at, &steps, sizeof at);
  for (int i = 0; i < kLanes; i += kHalf) {
    HalfFloats half;
    std::memcpy(&half, at + i, sizeof half);
    const DoubleRegister rounded = __builtin_convertvector(half, DoubleRegister) + kNoFraction;
    LongRegister sum;
    std::memcpy(&sum, sums + i, sizeof sum);
    sum += (LongRegister)rounded - std::bit_cast<std::int64_t>(kNoFraction);
    std::memcpy(sums + i, &sum, sizeof sum);
  }
}

/// The colours that sixteen texels see of Gaussians: their harmonics, looked at against the
/// texels' normals.
class SeenColours {
 public:
  /// `any`: of the Gaussians, which all have as many lobes.
  SeenColours(const SplatShape& any, const TexelPacket& packet) {
    if (any.lobes == 0) return;
    basis_ =
        sh_basis<float>(0.0F - load(packet.nx), 0.0F - load(packet.ny), 0.0F - load(packet.nz));
  }
  Floats operator()(const SplatShape& g, int channel) const {
    if (g.lobes == 0) return all(g.colour[channel]);
    Floats sum = all(g.colour[channel]);
    for (int k = 0; k < g.lobes; ++k)
      sum = sum + basis_[static_cast<std::size_t>(k + 1)] * g.sh[3 * k + channel];
    sum = select(sum > all(0.0F), sum, all(0.0F));
    return select(sum < source::kLargestSplatColour, sum, all(source::kLargestSplatColour));
  }

 private:
  std::array<Floats, 16> basis_;
};

void accumulate(std::span<const SplatResponse> responses, const TexelPacket& packet,
                DepthPacket& depths) {
  if (responses.empty()) return;
  const SeenColours seen(*responses.front().shape, packet);
  const Floats per_width = load(depths.per_width), centre = load(depths.centre),
               take = load(depths.take);
  for (const SplatResponse& response : responses) {
    const Floats x = (load(response.depth) - centre) * per_width;
    const Ints inside = (x >= -kWindowReach) & (x <= kWindowReach) & (take > 0.0F);
    if (!any(inside)) continue;
    const Floats safe = select(inside, x, all(0.0F));
    const Floats weight =
        select(inside, load(response.weight) * response.shape->roundness, all(0.0F)) *
        exp_of_minus(safe * safe * 0.5F);
    add_steps(weight, depths.weight);
    for (int c = 0; c < 3; ++c) add_steps(weight * seen(*response.shape, c), depths.colour[c]);
  }
}

/// One Gaussian on the rays of sixteen texels: alpha x response x cosine, and where.
[[gnu::always_inline]] inline void add_one(const SplatShape& g, const Rays& ray,
                                           const Floats& reach, float min_cosine, RayPacket& sums) {
  const auto along_normal = [&](const float* a) {
    return a[0] * ray.nx + a[1] * ray.ny + a[2] * ray.nz;
  };
  Floats cosine = along_normal(g.normal);
  cosine = select(all(g.two_sided) > all(0), absolute(cosine), cosine);
  const Floats dx = (g.mean[0] - ray.px) * ray.per_texel, dy = (g.mean[1] - ray.py) * ray.per_texel,
               dz = (g.mean[2] - ray.pz) * ray.per_texel;
  const Floats mx = dy * ray.nz - dz * ray.ny, my = dz * ray.nx - dx * ray.nz,
               mz = dx * ray.ny - dy * ray.nx;
  const auto along_m = [&](const float* a) { return a[0] * mx + a[1] * my + a[2] * mz; };
  const Floats u0 = along_normal(g.axis[0]), u1 = along_normal(g.axis[1]),
               u2 = along_normal(g.axis[2]);
  const Floats v0 = along_m(g.axis[0]), v1 = along_m(g.axis[1]), v2 = along_m(g.axis[2]);
  const Floats scale = ray.per_texel * ray.per_texel;
  const Floats s0 = g.variance[0] * scale, s1 = g.variance[1] * scale, s2 = g.variance[2] * scale;
  const Floats per_det = 1.0F / (u0 * u0 * (s1 * s2) + u1 * u1 * (s0 * s2) + u2 * u2 * (s0 * s1));
  const Floats sv0 = s0 * v0, sv1 = s1 * v1, sv2 = s2 * v2;
  const Floats q = (sv0 * v0 + sv1 * v1 + sv2 * v2) * per_det;
  const Floats bend =
      u0 * u1 * (s0 - s1) * sv2 + u1 * u2 * (s1 - s2) * sv0 + u2 * u0 * (s2 - s0) * sv1;
  const Floats depth = absolute(dx * ray.nx + dy * ray.ny + dz * ray.nz - bend * per_det);
  // No number compares as true, so a Gaussian without extent adds nothing.
  const Ints ok =
      (q <= source::kSplatCutOff * source::kSplatCutOff) & (cosine >= min_cosine) & (depth < reach);
  if (!any(ok)) return;
  const Floats plain =
      select(ok, cosine, all(0.0F)) * exp_of_minus(select(ok, q, all(0.0F)) * 0.5F);
  const Floats weight = plain * g.alpha;
  add_steps(plain, sums.plain);
  add_steps(weight, sums.weight);
  for (int c = 0; c < 3; ++c) add_steps(weight * g.colour[c], sums.colour[c]);
  add_steps(select(ok, weight * depth / reach, all(0.0F)), sums.away);
}

void add_met(const SplatCandidates& candidates, const RayBundle& bundle, float height,
             const TexelPacket& packet, const RayLimits& limits, RayPacket& sums) {
  const Rays rays(packet);
  const Floats reach = load(sums.reach) * rays.per_texel;
  for (std::size_t i = 0; i < candidates.size(); i += kLanes) {
    unsigned left = meet(candidates.x(i), candidates.y(i), candidates.z(i), candidates.radius(i),
                         bundle, height);
    if (candidates.size() - i < kLanes) left &= (1U << (candidates.size() - i)) - 1;
    for (; left != 0; left &= left - 1) {
      add_one(candidates.shape(i + static_cast<std::size_t>(std::countr_zero(left))), rays, reach,
              limits.min_cosine, sums);
    }
  }
}

}  // namespace

extern const SplatKernels kSplatKernels;
const SplatKernels kSplatKernels{POUNCE_ISA_NAME, gather, respond, deposit, accumulate, add_met};

}  // namespace pounce::projection::POUNCE_ISA_NAMESPACE
