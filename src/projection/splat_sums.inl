// SPDX-License-Identifier: Apache-2.0
//
// What Gaussians add to their texels, in whole steps: of a scene what its profile lets through, of
// a mesh's texels all that a ray meets. Included by splat_kernels.inl, inside POUNCE_ISA_NAMESPACE.

constexpr float kUnhidden = 0.5F;       // bins before a Gaussian that do not hide it
constexpr float kUnhiddenDiscs = 1.5F;  // and further ones in scenes of discs

/// Optical depth until `before` bins before a response, between bins linearly.
[[gnu::always_inline]] inline Floats depth_until(const ProfilePacket& profile,
                                                 const SplatResponse& response, float before) {
  const float shift = 1 - before;  // before bin 0 there is one of nothing
  const Floats at = largest(load(response.at) + shift, 0.0F);
  const Ints bin = to_int(at);
  const Floats part = at - to_float(bin);
  const auto bin_of = [&](std::int32_t k) {
    return static_cast<std::int32_t>(std::floor(static_cast<float>(k) + shift));
  };
  const std::int32_t first = std::max(bin_of(response.first), 1),
                     last = std::min(bin_of(response.last + 1) + 1, kProfileBins);
  Floats sum = all(0.0F);
  for (std::int32_t k = first; k <= last; ++k) {
    const Floats here = to_float(load(profile.bins[k - 1]));
    sum =
        sum + here * select(bin == all(k), 1.0F - part, select(bin == all(k - 1), part, all(0.0F)));
  }
  return sum * (1 / kSplatSteps);
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
    return select(sum < gaussian::kLargestSplatColour, sum, all(gaussian::kLargestSplatColour));
  }

 private:
  std::array<Floats, 16> basis_;
};

// Half registers, because doubles are twice as wide.
constexpr int kHalf = kWidth / 2;
using HalfFloats = float __attribute__((vector_size(4 * kHalf)));
using DoubleRegister = double __attribute__((vector_size(8 * kHalf)));
using LongRegister = std::uint64_t __attribute__((vector_size(8 * kHalf)));

/// Sums of values in whole steps of 2^-36, in registers while Gaussians go past.
template <int count>
class StepSums {
 public:
  /// Adds 0 <= value <= 8 to sum `at`: a double of 2^52 and more has no fraction, so the low bits
  /// of value + 2^52 are its rounded steps. What 2^52 itself is made of comes off at the end.
  [[gnu::always_inline]] void add(int at, const Floats& value) {
    const Floats steps = value * static_cast<float>(kSumSteps);  // exact
    float lanes[kLanes];
    std::memcpy(lanes, &steps, sizeof lanes);
    for (int i = 0; i < kLanes / kHalf; ++i) {
      HalfFloats half;
      std::memcpy(&half, lanes + i * kHalf, sizeof half);
      const DoubleRegister rounded = __builtin_convertvector(half, DoubleRegister) + kNoFraction;
      sums_[at][i] += (LongRegister)rounded;
    }
  }
  /// To what sum `at` has in memory, `added` having been given to it.
  void store(int at, std::uint64_t added, std::int64_t* sums) const {
    const std::uint64_t beside = added * std::bit_cast<std::uint64_t>(kNoFraction);
    for (int i = 0; i < kLanes / kHalf; ++i) {
      LongRegister sum;
      std::memcpy(&sum, sums + i * kHalf, sizeof sum);
      sum += sums_[at][i] - beside;
      std::memcpy(sums + i * kHalf, &sum, sizeof sum);
    }
  }

 private:
  static constexpr double kNoFraction = 4503599627370496.0;  // 2^52
  LongRegister sums_[count][kLanes / kHalf] = {};
};

/// How sixteen texels weigh what they see.
class Weights {
 public:
  Weights(const TexelPacket& packet, const ProfilePacket& profile, const SplatLimits& limits,
          const DepthPacket& depths)
      : ray_(packet),
        profile_(profile),
        limits_(limits),
        width_(1.0F / load(depths.per_bin)),
        anchor_(load(depths.anchor)),
        focus_(load(depths.focus)),
        per_window_(load(depths.per_window)),
        per_anchor_(kReachOverAnchor / limits.reach),
        unhidden_(kUnhidden + kUnhiddenDiscs * limits.discness) {}

  /// What is seen of a response; false if that is nothing.
  [[gnu::always_inline]] bool seen(const SplatResponse& response, Floats& weight) const {
    const Floats all_of_it =
        load(response.alpha) * exp_of_minus_far(depth_until(profile_, response, unhidden_));
    const Ints is_seen = all_of_it >= kLeastSeen;
    weight = select(is_seen, all_of_it, all(0.0F));
    return any(is_seen);
  }
  /// How much of that counts.
  [[gnu::always_inline]] Floats of(const SplatResponse& response, Floats weight) const {
    const Floats t = limits_.reach - load(response.at) * width_;
    const Floats before = largest((t - anchor_) * per_anchor_, 0.0F);
    weight = weight * exp_of_minus(before * before * 0.5F);
    if (limits_.discness <= 0) return weight;
    const SplatShape& g = *response.shape;
    const Floats cosine = g.normal[0] * ray_.nx + g.normal[1] * ray_.ny + g.normal[2] * ray_.nz;
    const Floats disc = cosine * cosine * g.flatness;
    const Floats z = (t - focus_) * per_window_;
    return weight * (1.0F - limits_.discness + limits_.discness * disc) *
           exp_of_minus_far(z * z * (0.5F * limits_.discness));
  }

 private:
  Rays ray_;
  const ProfilePacket& profile_;
  const SplatLimits& limits_;
  Floats width_, anchor_, focus_, per_window_;
  float per_anchor_, unhidden_;
};

void accumulate(std::span<const SplatResponse> responses, const TexelPacket& packet,
                const ProfilePacket& profile, const SplatLimits& limits, DepthPacket& depths) {
  if (responses.empty()) return;
  const Weights weights(packet, profile, limits, depths);
  const SeenColours colours(*responses.front().shape, packet);
  constexpr int kWeight = 0, kColour = 1, kSquare = 4, kDepth = 5;
  StepSums<6> sums;
  std::uint64_t added = 0;
  for (std::size_t first = 0; first < responses.size(); first += kAtOnce) {
    // In passes, as in splat_response.inl.
    const SplatResponse* seen[kAtOnce];
    Floats weight[kAtOnce];
    std::size_t count = 0;
    for (const SplatResponse& response :
         responses.subspan(first, std::min(kAtOnce, responses.size() - first))) {
      seen[count] = &response;
      count += weights.seen(response, weight[count]) ? 1 : 0;
    }
    for (std::size_t i = 0; i < count; ++i) weight[i] = weights.of(*seen[i], weight[i]);
    for (std::size_t i = 0; i < count; ++i) {
      const Floats own = weight[i];
      sums.add(kWeight, own);
      Floats square = all(0.0F);
      for (int c = 0; c < 3; ++c) {
        const Floats colour = colours(*seen[i]->shape, c);
        sums.add(kColour + c, own * colour);
        const Floats shown = select(colour < 1.0F, colour, all(1.0F));
        square = square + shown * shown;
      }
      sums.add(kSquare, own * square);
      const Floats place = load(seen[i]->at) * (1.0F / kProfileBins);
      sums.add(kDepth, own * place);
    }
    added += count;
  }
  sums.store(kWeight, added, depths.weight);
  for (int c = 0; c < 3; ++c) sums.store(kColour + c, added, depths.colour[c]);
  sums.store(kSquare, added, depths.square);
  sums.store(kDepth, added, depths.depth);
}

/// What add_met() adds up.
struct MetSums {
  static constexpr int kPlain = 0, kWeight = 1, kColour = 2, kAway = 5;
  StepSums<6> steps;
  std::uint64_t added = 0;
};

/// One Gaussian on the rays of sixteen texels: alpha x response x cosine, and where.
[[gnu::always_inline]] inline void add_one(const SplatShape& g, const Rays& ray,
                                           const Floats& reach, float min_cosine, MetSums& sums) {
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
  const Ints ok = (q <= gaussian::kSplatCutOff * gaussian::kSplatCutOff) & (cosine >= min_cosine) &
                  (depth < reach);
  if (!any(ok)) return;
  const Floats plain =
      select(ok, cosine, all(0.0F)) * exp_of_minus(select(ok, q, all(0.0F)) * 0.5F);
  const Floats weight = plain * g.alpha;
  ++sums.added;
  sums.steps.add(MetSums::kPlain, plain);
  sums.steps.add(MetSums::kWeight, weight);
  for (int c = 0; c < 3; ++c) sums.steps.add(MetSums::kColour + c, weight * g.colour[c]);
  sums.steps.add(MetSums::kAway, select(ok, weight * depth / reach, all(0.0F)));
}

void add_met(const SplatCandidates& candidates, const RayBundle& bundle, float height,
             const TexelPacket& packet, const RayLimits& limits, RayPacket& sums) {
  const Rays rays(packet);
  const Floats reach = load(sums.reach) * rays.per_texel;
  MetSums met;
  for (std::size_t i = 0; i < candidates.size(); i += kLanes) {
    unsigned left = meet(candidates.x(i), candidates.y(i), candidates.z(i), candidates.radius(i),
                         bundle, height);
    if (candidates.size() - i < kLanes) left &= (1U << (candidates.size() - i)) - 1;
    for (; left != 0; left &= left - 1) {
      add_one(candidates.shape(i + static_cast<std::size_t>(std::countr_zero(left))), rays, reach,
              limits.min_cosine, met);
    }
  }
  met.steps.store(MetSums::kPlain, met.added, sums.plain);
  met.steps.store(MetSums::kWeight, met.added, sums.weight);
  for (int c = 0; c < 3; ++c) met.steps.store(MetSums::kColour + c, met.added, sums.colour[c]);
  met.steps.store(MetSums::kAway, met.added, sums.away);
}
