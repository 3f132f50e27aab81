// SPDX-License-Identifier: Apache-2.0
//
// What Gaussians give to sixteen texels, in passes: a Gaussian's way from the ray to its alpha is
// one long chain of operations, so what keeps a processor busy is many of them side by side, each
// pass short, without a branch that only the chain's end decides. Included by splat_kernels.inl,
// inside POUNCE_ISA_NAMESPACE.

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

/// The first and the last of the bins that the lanes of a mask are in, of which one is set.
[[gnu::always_inline]] inline void range_of(const Ints& bin, const Ints& mask, std::int32_t& first,
                                            std::int32_t& last) {
  const Ints bins =
      each([](IntRegister b, IntRegister m) { return (IntRegister{} + 1) << b & m; }, bin, mask);
  IntRegister some = bins.part[0];
  for (int p = 1; p < kParts; ++p) some |= bins.part[p];
  std::uint64_t pairs[kWidth / 2], met = 0;
  std::memcpy(pairs, &some, sizeof pairs);
  for (const std::uint64_t pair : pairs) met |= pair;
  const auto set = static_cast<std::uint32_t>(met | met >> 32);
  first = std::countr_zero(set);
  last = std::bit_width(set) - 1;
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

/// Gaussians before a packet, so many at once.
constexpr std::size_t kAtOnce = 16;

/// Where Gaussians lie to sixteen rays: what passing them takes, and what is needed after that.
struct Passing {
  Floats u[3];     ///< axes . n
  Floats gv[3];    ///< variances, as seen, times axes . (d x n)
  Floats per_det;  ///< 1 / det M
  Floats q;        ///< squared distance, in deviations
  Floats along;    ///< n . d
  Ints ok;         ///< lanes that it reaches
};

/// One Gaussian and sixteen texels; false if it passes all of them.
[[gnu::always_inline]] inline bool pass(const SplatShape& g, const Lookers& ray, Passing& out) {
  const auto along_normal = [&](const float* a) {
    return a[0] * ray.nx + a[1] * ray.ny + a[2] * ray.nz;
  };
  const float per_edge = ray.per_edge;
  const Floats dx = (g.mean[0] - ray.px) * per_edge, dy = (g.mean[1] - ray.py) * per_edge,
               dz = (g.mean[2] - ray.pz) * per_edge;
  const Floats mx = dy * ray.nz - dz * ray.ny, my = dz * ray.nx - dx * ray.nz,
               mz = dx * ray.ny - dy * ray.nx;
  const float scale = per_edge * per_edge;
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
  const Ints ok = (q <= gaussian::kSplatCutOff * gaussian::kSplatCutOff) & ray.used;
  out = {{u0, u1, u2}, {gv0, gv1, gv2}, per_det, q, dx * ray.nx + dy * ray.ny + dz * ray.nz, ok};
  return any(ok);
}

/// What one that reaches some lane gives; false if that is nothing. `mass` is what the profile gets
/// of it, in `bin`.
[[gnu::always_inline]] inline bool respond_to(const SplatShape& g, const Passing& passing,
                                              const Lookers& ray, const SplatLimits& limits,
                                              SplatResponse& out, Floats& mass, Ints& bin) {
  const float per_edge = ray.per_edge, scale = per_edge * per_edge;
  const float s0 = g.variance[0] * scale, s1 = g.variance[1] * scale, s2 = g.variance[2] * scale;
  const auto& [u0, u1, u2] = passing.u;
  const auto& [gv0, gv1, gv2] = passing.gv;
  const Floats per_det = passing.per_det;
  const Floats bend =
      u0 * u1 * (s0 - s1) * gv2 + u1 * u2 * (s1 - s2) * gv0 + u2 * u0 * (s2 - s0) * gv1;
  const Floats t = (passing.along - bend * per_det) * (1 / per_edge);
  Ints ok = passing.ok & (absolute(t) <= ray.reach);
  if (g.two_sided == 0) {
    const Floats cosine = g.normal[0] * ray.nx + g.normal[1] * ray.ny + g.normal[2] * ray.nz;
    ok = ok & (cosine >= limits.min_cosine);
  }
  // How much fainter a fine footprint makes it: all of that where the scene was trained so, half
  // (in decibels) where it was not. What a coarse one adds keeps its integral.
  const Floats uu0 = u0 * u0, uu1 = u1 * u1, uu2 = u2 * u2;
  const Floats bare = uu0 * (s1 * s2) + uu1 * (s0 * s2) + uu2 * (s0 * s1);
  Floats per_fine = per_det, spread = all(1.0F);
  if (ray.is_coarse) {
    const Floats f0 = s0 + ray.fine, f1 = s1 + ray.fine, f2 = s2 + ray.fine;
    const Floats g0 = s0 + ray.footprint, g1 = s1 + ray.footprint, g2 = s2 + ray.footprint;
    const Floats det = uu0 * (g1 * g2) + uu1 * (g0 * g2) + uu2 * (g0 * g1);
    const Floats fine = uu0 * (f1 * f2) + uu1 * (f0 * f2) + uu2 * (f0 * f1);
    per_fine = 1.0F / fine;
    spread = fine / det;  // exactly 1 for a fine texel
  }
  Floats kept = square_root(bare * per_fine);
  if (!limits.antialiased) kept = square_root(kept);
  if (ray.is_coarse) kept = kept * square_root(spread);
  const Floats safe = select(ok, passing.q, all(0.0F));
  const Floats peak = select(ok, g.alpha * kept, all(0.0F));
  Floats alpha = peak * exp_of_minus(safe * 0.5F);
  alpha = select(alpha < kMostAlpha, alpha, all(kMostAlpha));
  const Floats at = select(ok, (ray.reach - t) * ray.per_bin, all(0.0F));
  bin = to_int(at);
  mass = peak * (1.0F - safe * kPerCutOff) * kBlurred;
  store(out.alpha, alpha);
  store(out.at, at);
  range_of(bin, ok, out.first, out.last);
  out.shape = &g;
  return any(ok);
}

/// The Gaussians `near`, at most kAtOnce.
[[gnu::always_inline]] inline std::size_t respond_to(std::span<const SplatShape* const> near,
                                                     const Lookers& rays, const SplatLimits& limits,
                                                     SplatResponse* out, ProfilePacket* profile) {
  Passing passings[kAtOnce];
  const SplatShape* met[kAtOnce];
  std::size_t reached = 0, kept = 0;
  for (const SplatShape* g : near) {
    met[reached] = g;
    reached += pass(*g, rays, passings[reached]) ? 1 : 0;
  }
  Floats mass[kAtOnce];
  Ints bin[kAtOnce];
  for (std::size_t i = 0; i < reached; ++i) {
    const bool keep =
        respond_to(*met[i], passings[i], rays, limits, out[kept], mass[kept], bin[kept]);
    kept += keep ? 1 : 0;
  }
  if (profile != nullptr) {
    for (std::size_t i = 0; i < kept; ++i)
      deposit(mass[i], load(out[i].at), bin[i], out[i].first, out[i].last, *profile);
  }
  return kept;
}

/// Gaussians lie where the store has them, not where they are asked for.
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
    for (; left != 0; left &= left - 1) {
      near[count] = &candidates.shape(i + static_cast<std::size_t>(std::countr_zero(left)));
      prefetch(*near[count++]);
    }
  }
  const Lookers rays(packet, depths, limits);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; i += kAtOnce) {
    kept += respond_to(std::span(near + i, std::min(kAtOnce, count - i)), rays, limits, out + kept,
                       profile);
  }
  return kept;
}
