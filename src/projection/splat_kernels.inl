// SPDX-License-Identifier: Apache-2.0
//
// The response of Gaussians to texels, compiled once per instruction set with POUNCE_ISA_NAMESPACE
// set.
//
// Along the ray x + t n the largest response of a Gaussian (mean m, covariance S) is that of its 2D
// marginal in the plane across n, exp(-q / 2) with q = D' M^-1 D, M = T S T' + f I, D = T (m - x),
// where T spans the plane and f is the texel's footprint: 0.3 s^2 for an edge s, where that is
// coarse 0.3 r^2 + (s^2 - r^2) / 12, with r the longest edge that is fine. It lies at the
// conditional mean t = n.(m - x) - (n' S T') M^-1 D. Neither a 3x3 inverse nor T is needed. With
// the Gaussian's axes a_k, variances s_k, u_k = a_k . n, d = m - x, v_k = a_k . (d x n) and g_k =
// s_k + f:
//
//   det M = u_0^2 g_1 g_2 + u_1^2 g_0 g_2 + u_2^2 g_0 g_1
//   q     = (g_0 v_0^2 + g_1 v_1^2 + g_2 v_2^2) / det M
//   t     = n.d - sum over cyclic (i, j, k) of u_i u_j (s_i - s_j) g_k v_k / det M
//
// (minors of M after Cauchy and Binet, and u_0^2 + u_1^2 + u_2^2 = 1). All terms of the first two
// are positive: nothing cancels, however thin a disc or a needle is. Here lengths are in edges of
// about the packet's largest texel, so that products of four do not leave what floats can hold.
//
// The plain blend of a mesh's texels (add_met) is the same with f = 0 and other weights. What is
// added up is in splat_sums.inl.
#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/directions.h"
#include "projection/splat_packet.h"

namespace pounce::projection::POUNCE_ISA_NAMESPACE {
namespace {

#include "projection/lanes.inl"

using gaussian::SplatShape;

#include "projection/exp_lanes.inl"

constexpr float kMostAlpha = 0.99F;
constexpr float kPerCutOff = 1 / (gaussian::kSplatCutOff * gaussian::kSplatCutOff);
constexpr float kBlurred = 0.4F;       // of a Gaussian's optical depth, spread over more texels
constexpr float kReachOverAnchor = 3;  // where the target is thought to lie, in its deviations

// --- what a bundle may meet ----------------------------------------------------------------------
//
// Which Gaussians the rays of a bundle may meet: by their spheres, then by their ellipses.

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

unsigned meet(const gaussian::SplatSpheres& spheres, std::size_t i, const RayBundle& bundle,
              float height) {
  const unsigned found = meet(&spheres.centre[0][i], &spheres.centre[1][i], &spheres.centre[2][i],
                              &spheres.radius[i], bundle, height);
  const std::size_t left = spheres.count - i;
  return left < kLanes ? found & ((1U << left) - 1) : found;
}

/// A bundle that looks at ellipses: every ray lies in a cone around its first, so what it meets of
/// a Gaussian lies in the ellipse that the Gaussian has across that first ray, grown by the cone.
/// The sum of an ellipse of the matrix A and a disc of radius r is within that of (1 + b) A + (1 +
/// 1 / b) r^2 I for any b > 0.
class EllipseSight {
 public:
  /// `bundle` without footprints.
  EllipseSight(const RayBundle& bundle, float height, float footprint)
      : bundle_(bundle), height_(height), footprint_(footprint) {
    const Vec3f d = bundle.direction;
    const Vec3f helper = std::abs(d.x) < 0.6F ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0};
    u_ = cross(d, helper);
    const float square = dot(u_, u_);
    sees_all_ = !(square > 0.25F);  // no direction
    u_ = u_ * (1 / std::sqrt(sees_all_ ? 1 : square));
    v_ = cross(d, u_);
    per_depth_ = 1 / std::max(1 - bundle.spread, 0.01F);
    set(u_, u_, uu_);
    set(u_, v_, uv_);
    set(v_, v_, vv_);
  }

  /// May it meet these sixteen? A bit each; `covariance(c)` is where their components are.
  template <class Covariance>
  unsigned meet(const float* x, const float* y, const float* z, const float* radius,
                const Covariance& covariance) const {
    if (sees_all_) return 0xFFFF;
    const Vec3f o = bundle_.origin, d = bundle_.direction;
    const Floats vx = load(x) - o.x, vy = load(y) - o.y, vz = load(z) - o.z;
    const auto along = [&](Vec3f a) { return vx * a.x + vy * a.y + vz * a.z; };
    // How far along its ray one of the bundle can be where it meets the Gaussian.
    const Floats depth = (absolute(along(d)) + (load(radius) + bundle_.offset)) * per_depth_;
    const Floats a = along(u_), b = along(v_);
    Floats xx = all(footprint_), xy = all(0.0F), yy = all(footprint_);
    for (std::size_t c = 0; c < 6; ++c) {
      const Floats s = load(covariance(c));
      xx = xx + s * uu_[c];
      xy = xy + s * uv_[c];
      yy = yy + s * vv_[c];
    }
    const Floats r =
        (bundle_.offset + select(depth < height_, depth, all(height_)) * bundle_.spread) * 1.0001F;
    const Floats size = square_root((xx + yy) * (0.5F * kSquaredCutOff)) + 1e-30F;
    const Floats grown = (1.0F + r / size) * kSquaredCutOff, disc = r * (r + size);
    xx = grown * xx + disc;
    xy = grown * xy;
    yy = grown * yy + disc;
    const Floats aa = a * a * yy, bb = b * b * xx, det = xx * yy;
    // Rounding may not keep any out.
    return bits(aa + bb - 2.0F * a * b * xy <= (det - xy * xy) * 1.001F + (aa + bb + det) * 1e-6F);
  }

 private:
  static constexpr float kSquaredCutOff = gaussian::kSplatCutOff * gaussian::kSplatCutOff;
  /// The weights of a covariance's six components in a' S b.
  static void set(Vec3f a, Vec3f b, float* weights) {
    const float w[6] = {a.x * b.x, a.x * b.y + a.y * b.x, a.x * b.z + a.z * b.x,
                        a.y * b.y, a.y * b.z + a.z * b.y, a.z * b.z};
    std::copy_n(w, 6, weights);
  }

  RayBundle bundle_;
  float height_, footprint_;
  Vec3f u_, v_;  ///< across the direction
  float uu_[6], uv_[6], vv_[6];
  float per_depth_ = 1;
  bool sees_all_ = false;
};

void gather(const gaussian::SplatSet& set, const RayBundle& bundle, float height, float footprint,
            SplatCandidates& out) {
  RayBundle spheres = bundle;
  spheres.offset += gaussian::kSplatCutOff * std::sqrt(footprint) * 1.0001F;
  const EllipseSight sight(bundle, height, footprint);
  const auto& level = set.levels[0];
  for (std::size_t i = 0; i < set.levels[2].count; i += kLanes) {
    for (unsigned a = meet(set.levels[2], i, spheres, height); a != 0; a &= a - 1) {
      const std::size_t j = (i + static_cast<std::size_t>(std::countr_zero(a))) * kLanes;
      for (unsigned b = meet(set.levels[1], j, spheres, height); b != 0; b &= b - 1) {
        const std::size_t k = (j + static_cast<std::size_t>(std::countr_zero(b))) * kLanes;
        unsigned c = meet(level, k, spheres, height);
        if (c == 0) continue;
        c &= sight.meet(&level.centre[0][k], &level.centre[1][k], &level.centre[2][k],
                        &level.radius[k], [&](std::size_t at) { return &set.covariance[at][k]; });
        for (; c != 0; c &= c - 1) out.add(set, k + static_cast<std::size_t>(std::countr_zero(c)));
      }
    }
  }
}

// --- blending ------------------------------------------------------------------------------------

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

inline Ints least(const Ints& a, std::int32_t b) {
  return each([b](IntRegister x) { return x < b ? x : IntRegister{} + b; }, a);
}
inline Floats largest(const Floats& a, float b) { return select(a > b, a, all(b)); }

/// The packet's texels and what of them counts for every Gaussian.
struct Lookers : Rays {
  Lookers(const TexelPacket& packet, const DepthPacket& depths, const SplatLimits& limits)
      : Rays(packet),
        per_edge(std::ldexp(
            1.0F, -std::clamp(std::ilogb(std::sqrt(depths.footprint / kFootprint)), -100, 100))),
        fine(footprint_up_to(limits.fine_edge)),
        footprint(fine + beyond(limits.fine_edge) * kBoxVariance),
        is_coarse(any(footprint > fine)),
        widest(depths.footprint * per_edge * per_edge),
        per_bin(load(depths.per_bin)),
        reach(limits.reach) {
    for (int lane = 0; lane < kLanes; ++lane) used_lanes[lane] = -(depths.used >> lane & 1);
    used = load(used_lanes);
  }
  alignas(64) std::int32_t used_lanes[kLanes];
  Ints used;
  /// 1 / the unit of lengths: about the largest edge of the packet's texels, and a power of two, so
  /// that a texel's results do not depend on who shares its packet.
  float per_edge;
  Floats fine;       ///< the footprint, were no texel coarse
  Floats footprint;  ///< the whole of it
  bool is_coarse;    ///< some texel
  float widest;      ///< of the footprints
  Floats per_bin;
  float reach;

 private:
  /// Of the texels' squared edges, in the unit: at most that of a fine edge, and what is beyond it.
  /// Exactly none for a fine texel, whoever shares its packet.
  Floats footprint_up_to(float fine_edge) const {
    const Floats own = (1.0F / (per_texel * per_texel)) * (kFootprint * per_edge * per_edge);
    return select(is_fine(fine_edge), own, all(kFootprint * squared(fine_edge)));
  }
  Floats beyond(float fine_edge) const {
    const Floats own = (1.0F / (per_texel * per_texel)) * (per_edge * per_edge);
    return select(is_fine(fine_edge), all(0.0F), own - squared(fine_edge));
  }
  Ints is_fine(float fine_edge) const { return 1.0F / per_texel <= all(fine_edge); }
  float squared(float edge) const { return edge * per_edge * (edge * per_edge); }
};

/// The smallest of the lanes of a register, halving it: each lane meets the one `half` away.
template <int half, int... lane>
[[gnu::always_inline]] inline std::int32_t smallest(IntRegister low,
                                                    std::integer_sequence<int, lane...> lanes) {
  const IntRegister other = __builtin_shufflevector(low, low, (lane ^ half)...);
  low = other < low ? other : low;
  if constexpr (half > 1) return smallest<half / 2>(low, lanes);
  return low[0];
}

/// The smallest of sixteen lanes.
[[gnu::always_inline]] inline std::int32_t smallest(const Ints& values) {
  IntRegister low = values.part[0];
  for (int p = 1; p < kParts; ++p) low = values.part[p] < low ? values.part[p] : low;
  return smallest<kWidth / 2>(low, std::make_integer_sequence<int, kWidth>());
}

/// The smallest and the largest of the lanes of a mask, of which one is set.
[[gnu::always_inline]] inline void range_of(const Ints& values, const Ints& mask,
                                            std::int32_t& first, std::int32_t& last) {
  const Ints low = select(mask, values, all(kProfileBins)),
             high = select(mask, all(0) - values, all(0));
  first = smallest(low);
  last = -smallest(high);
}

/// A depth is shared by the two bins around it: the profile follows it smoothly. Bins from `first`
/// to `last` are met.
[[gnu::always_inline]] inline void deposit(const Floats& mass, const Floats& at, const Ints& bin,
                                           std::int32_t first, std::int32_t last,
                                           ProfilePacket& profile) {
  const Ints whole = to_int(mass * kSplatSteps + 0.5F);
  const Ints above = to_int(mass * (at - to_float(bin)) * kSplatSteps + 0.5F);
  const Ints low = whole - above;
  // Clamped sums of what is never negative come out the same in any order.
  for (std::int32_t k = first; k <= last + 1; ++k) {
    const Ints here = select(bin == all(k), low, all(0)) + select(bin == all(k - 1), above, all(0));
    store(profile.bins[k], least(load(profile.bins[k]) + here, kFullBin));
  }
}

/// One Gaussian and sixteen texels; false if none of them gets anything.
[[gnu::always_inline]] inline bool respond_to(const SplatShape& g, const Lookers& ray,
                                              const SplatLimits& limits, SplatResponse& out,
                                              ProfilePacket* profile) {
  const auto along_normal = [&](const float* a) {
    return a[0] * ray.nx + a[1] * ray.ny + a[2] * ray.nz;
  };
  const float per_edge = ray.per_edge;
  const Floats dx = (g.mean[0] - ray.px) * per_edge, dy = (g.mean[1] - ray.py) * per_edge,
               dz = (g.mean[2] - ray.pz) * per_edge;
  const Floats mx = dy * ray.nz - dz * ray.ny, my = dz * ray.nx - dx * ray.nz,
               mz = dx * ray.ny - dy * ray.nx;
  const float scale = per_edge * per_edge;
  // Most of what comes here passes all rays: its sphere says so sooner.
  const Floats away = mx * mx + my * my + mz * mz;
  const float widest = (g.variance[0] * scale + ray.widest) * (1.0001F / kPerCutOff);
  if (!any(away <= widest)) return false;
  const auto along_m = [&](const float* a) { return a[0] * mx + a[1] * my + a[2] * mz; };
  const Floats u0 = along_normal(g.axis[0]), u1 = along_normal(g.axis[1]),
               u2 = along_normal(g.axis[2]);
  const Floats v0 = along_m(g.axis[0]), v1 = along_m(g.axis[1]), v2 = along_m(g.axis[2]);
  const float s0 = g.variance[0] * scale, s1 = g.variance[1] * scale, s2 = g.variance[2] * scale;
  const Floats g0 = s0 + ray.footprint, g1 = s1 + ray.footprint, g2 = s2 + ray.footprint;
  const Floats uu0 = u0 * u0, uu1 = u1 * u1, uu2 = u2 * u2;
  const Floats det = uu0 * (g1 * g2) + uu1 * (g0 * g2) + uu2 * (g0 * g1);
  const Floats gv0 = g0 * v0, gv1 = g1 * v1, gv2 = g2 * v2;
  const Floats per_det = 1.0F / det;
  const Floats q = (gv0 * v0 + gv1 * v1 + gv2 * v2) * per_det;
  Ints ok = (q <= gaussian::kSplatCutOff * gaussian::kSplatCutOff) & ray.used;
  if (!any(ok)) return false;
  const Floats bend =
      u0 * u1 * (s0 - s1) * gv2 + u1 * u2 * (s1 - s2) * gv0 + u2 * u0 * (s2 - s0) * gv1;
  const Floats t = (dx * ray.nx + dy * ray.ny + dz * ray.nz - bend * per_det) * (1 / per_edge);
  ok = ok & (absolute(t) <= ray.reach);
  if (g.two_sided == 0) ok = ok & (along_normal(g.normal) >= limits.min_cosine);
  if (!any(ok)) return false;
  // How much fainter a fine footprint makes it: all of that where the scene was trained so, half
  // (in decibels) where it was not. What a coarse one adds keeps its integral.
  const Floats bare = uu0 * (s1 * s2) + uu1 * (s0 * s2) + uu2 * (s0 * s1);
  Floats per_fine = per_det, spread = all(1.0F);
  if (ray.is_coarse) {
    const Floats f0 = s0 + ray.fine, f1 = s1 + ray.fine, f2 = s2 + ray.fine;
    const Floats fine = uu0 * (f1 * f2) + uu1 * (f0 * f2) + uu2 * (f0 * f1);
    per_fine = 1.0F / fine;
    spread = fine / det;  // exactly 1 for a fine texel
  }
  Floats kept = square_root(bare * per_fine);
  if (!limits.antialiased) kept = square_root(kept);
  if (ray.is_coarse) kept = kept * square_root(spread);
  const Floats safe = select(ok, q, all(0.0F));
  const Floats peak = select(ok, g.alpha * kept, all(0.0F));
  Floats alpha = peak * exp_of_minus(safe * 0.5F);
  alpha = select(alpha < kMostAlpha, alpha, all(kMostAlpha));
  const Floats at = select(ok, (ray.reach - t) * ray.per_bin, all(0.0F));
  const Ints bin = to_int(at);
  store(out.alpha, alpha);
  store(out.at, at);
  range_of(bin, ok, out.first, out.last);
  out.shape = &g;
  if (profile != nullptr) {
    deposit(peak * (1.0F - safe * kPerCutOff) * kBlurred, at, bin, out.first, out.last, *profile);
  }
  return true;
}

/// Gaussians lie where the store has them, not where they are asked for.
constexpr std::size_t kAhead = 4;
inline void prefetch(const SplatShape& g) {
  const auto* at = reinterpret_cast<const char*>(&g);
  __builtin_prefetch(at);
  __builtin_prefetch(at + 64);
}

std::size_t respond(const SplatCandidates& candidates, std::size_t first, std::size_t last,
                    const RayBundle& bundle, const TexelPacket& packet, const DepthPacket& depths,
                    const SplatLimits& limits, SplatResponse* out, ProfilePacket* profile) {
  const SplatShape* near[kMostResponses];
  std::size_t count = 0;
  RayBundle spheres = bundle;
  spheres.offset += gaussian::kSplatCutOff * std::sqrt(depths.footprint) * 1.0001F;
  const EllipseSight sight(bundle, limits.reach, depths.footprint);
  for (std::size_t i = first; i < last; i += kLanes) {
    unsigned left = meet(candidates.x(i), candidates.y(i), candidates.z(i), candidates.radius(i),
                         spheres, limits.reach);
    if (last - i < kLanes) left &= (1U << (last - i)) - 1;
    if (left == 0) continue;
    left &= sight.meet(candidates.x(i), candidates.y(i), candidates.z(i), candidates.radius(i),
                       [&](std::size_t c) { return candidates.covariance(c, i); });
    for (; left != 0; left &= left - 1)
      near[count++] = &candidates.shape(i + static_cast<std::size_t>(std::countr_zero(left)));
  }
  const Lookers rays(packet, depths, limits);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (i + kAhead < count) prefetch(*near[i + kAhead]);
    const bool keep = respond_to(*near[i], rays, limits, out[kept], profile);
    kept += keep ? 1 : 0;
  }
  return kept;
}

/// Values per bin of a profile.
using Bins = Floats[kProfileBins];

/// (1 4 6 4 1) / 16 over the bins, nothing beyond them.
Floats smooth(const Bins& bins, int k) {
  const auto bin = [&](int i) { return i < 0 || i >= kProfileBins ? all(0.0F) : bins[i]; };
  return (bin(k - 2) + bin(k + 2) + 4.0F * (bin(k - 1) + bin(k + 1)) + 6.0F * bin(k)) * 0.0625F;
}

/// What is seen of each bin through those before it.
void make_visible(const Bins& mass, Bins& visible) {
  Floats through = all(1.0F);
  for (int k = 0; k < kProfileBins; ++k) {
    const Floats kept = exp_of_minus_far(mass[k]);
    visible[k] = through * (1.0F - kept);
    through = through * kept;
  }
}

/// The first of the bins in which most is there and most of it is seen.
template <class Prior>
Floats peak_bin(const Bins& mass, const Bins& visible, const Prior& prior) {
  Floats best = all(-1.0F), at = all(0.0F);
  for (int k = 0; k < kProfileBins; ++k) {
    const Floats value = smooth(visible, k) * smooth(mass, k) * prior(k);
    const Ints is_better = value > best;
    best = select(is_better, value, best);
    at = select(is_better, all(static_cast<float>(k)), at);
  }
  return at;
}

void find_surface(const SplatLimits& limits, ProfilePacket& profile, DepthPacket& depths) {
  const Floats width = 1.0F / load(depths.per_bin);
  const float per_anchor = kReachOverAnchor / limits.reach;
  const auto depth = [&](int k) { return limits.reach - static_cast<float>(k) * width; };
  /// exp(-x^2 / 2), at its least from the reach on.
  const auto bell = [](const Floats& x) {
    const Floats half = x * x * 0.5F;
    return exp_of_minus(select(half < 4.5F, half, all(4.5F)));
  };
  Bins mass, visible;
  for (int k = 0; k < kProfileBins; ++k)
    mass[k] = to_float(load(profile.bins[k])) * (1 / kSplatSteps);
  make_visible(mass, visible);
  const float per_deviation = limits.deviation > 0 ? 1 / limits.deviation : per_anchor;
  const auto near_target = [&](int k) {
    return bell((depth(k) - limits.expected) * per_deviation);
  };
  const Floats at = peak_bin(mass, visible, near_target);
  const Floats anchor = largest(limits.reach - at * width, 0.0F);
  store(depths.anchor, anchor);
  Ints sum = all(0);
  for (int k = 0; k < kProfileBins; ++k) {
    const Floats before = largest((depth(k) - anchor) * per_anchor, 0.0F);
    mass[k] = mass[k] * bell(before);
    sum = sum + to_int(mass[k] * kSplatSteps + 0.5F);
    store(profile.bins[k], sum);
  }
  Floats focus = anchor;
  if (limits.discness > 0) {
    make_visible(mass, visible);
    const Floats peak = peak_bin(mass, visible, near_target);
    const Floats per_window = width * load(depths.per_window);
    Floats weights = all(0.0F), places = all(0.0F);
    for (int k = 0; k < kProfileBins; ++k) {
      const Floats z = (static_cast<float>(k) - peak) * per_window;
      const Floats near = exp_of_minus_far(z * z * 0.5F) * visible[k];
      weights = weights + near;
      places = places + near * static_cast<float>(k);
    }
    const Floats place = select(weights > 0.0F, places / largest(weights, 1e-30F), peak);
    focus = limits.reach - place * width;
  }
  store(depths.focus, focus);
}

#include "projection/splat_sums.inl"

}  // namespace

extern const SplatKernels kSplatKernels;
const SplatKernels kSplatKernels{POUNCE_ISA_NAME, gather,     respond,
                                 find_surface,    accumulate, add_met};

}  // namespace pounce::projection::POUNCE_ISA_NAMESPACE
