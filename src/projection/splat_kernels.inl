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
#include <limits>

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
[[gnu::always_inline]] inline unsigned meet(const float* x, const float* y, const float* z,
                                            const float* radius, const RayBundle& bundle,
                                            float height) {
  const Vec3f o = bundle.origin, d = bundle.direction;
  const Floats reach = (load(radius) + (bundle.offset + height * bundle.spread)) * 1.00001F;
  const Floats vx = load(x) - o.x, vy = load(y) - o.y, vz = load(z) - o.z;
  const Floats cx = vy * d.z - vz * d.y, cy = vz * d.x - vx * d.z, cz = vx * d.y - vy * d.x;
  const Floats along = absolute(vx * d.x + vy * d.y + vz * d.z);
  return bits((cx * cx + cy * cy + cz * cz <= reach * reach) & (along <= height + reach));
}

[[gnu::always_inline]] inline unsigned meet(const gaussian::SplatSpheres& spheres, std::size_t i,
                                            const RayBundle& bundle, float height) {
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
    // Beyond that a ray may lie across the direction, and how far it is along it says nothing.
    constexpr float kMostSpread = 0.99F;
    per_depth_ = bundle.spread < kMostSpread ? 1 / (1 - bundle.spread)
                                             : std::numeric_limits<float>::infinity();
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

void gather(const gaussian::SplatSet& set, const RayBundle& spheres, const EllipseSight& sight,
            float height, SplatCandidates& out) {
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

void gather(std::span<const gaussian::SplatSet* const> sets, const RayBundle& bundle, float height,
            float footprint, SplatCandidates& out) {
  RayBundle spheres = bundle;
  spheres.offset += gaussian::kSplatCutOff * std::sqrt(footprint) * 1.0001F;
  const EllipseSight sight(bundle, height, footprint);
  for (const gaussian::SplatSet* set : sets) gather(*set, spheres, sight, height, out);
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

#include "projection/splat_response.inl"

// --- the surface ---------------------------------------------------------------------------------

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
