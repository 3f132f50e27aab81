// SPDX-License-Identifier: Apache-2.0
//
// Splats onto texels: which of the Gaussians that a texel's normal meets does a viewer see?
//
// A viewer outside, looking along the normal, would see them front to back. The texel's answer is
// that picture without an order: each Gaussian weighs what it takes of the light that those before
// it let through, and what lies before it is read off a profile, optical depth by depth.
//
//   profile   bins from the outermost depth to the innermost. A Gaussian's mass is 0.4 alpha
//             (1 - q / 9), with q its squared distance from the ray: wider than the Gaussian
//             itself, so that a normal that passes between the surface's Gaussians finds a surface,
//             and one that meets a lone floater finds little
//   surface   the bin of which most is there and most is seen, near the texel rather than far: the
//             anchor. What lies farther out than that fades
//   sum       alpha x what the profile lets through, from half a bin before the Gaussian
//
// In scenes whose Gaussians are the discs of a surface (generated ones, meshes as Gaussians) what
// is no disc, or lies across, is an outlier, and the surface is a layer: there a Gaussian weighs
// how flat it is and how well it faces the texel, and a window keeps to that layer. In captures
// needles and balls carry the picture. SplatLimits::discness says which it is, from what the
// scene's Gaussians are like. Measured on both kinds in docs/decisions/023-splat-blend.md.
//
// A texel that is coarse beside the scene's Gaussians (SplatLimits::fine_edge) shows the mean of
// what it covers: each Gaussian is as a fine texel sees it, spread over the coarse one, its
// integral kept. Measured in docs/decisions/035-coarse-splats.md.
//
// All sums are of integers, a profile's bins end at a full one, so Gaussians may come in any order
// and batches.
//
// Further rays of a texel are looked along in the same way, each with a profile of its own, past
// the same candidates. The texel's colour is the mean of what they and the normal found, by opacity
// and cosine.
//
// Two passes over the Gaussians, profile and sum. Where all that a piece may meet is at hand, each
// packet keeps its responses from the first for the second.
#include "projection/splat_blend.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/portable_math.h"
#include "projection/hit_packet.h"
#include "projection/search.h"

namespace pounce::projection {
namespace {

struct Turn {
  double cosine = 1, sine = 0;
};

/// Share k / count of a whole turn, by the series of sine and cosine: the C library's own differ
/// from machine to machine. Good to 1e-14.
Turn turn(int k, int count) {
  const double angle = 2 * std::numbers::pi * (2 * k > count ? k - count : k) / count;
  Turn out;
  double term = 1;
  for (int i = 1; i < 32; i += 2) {
    term *= angle / i;
    out.sine += term;
    term *= -angle / (i + 1);
    out.cosine += term;
  }
  return out;
}

}  // namespace

surface::TexelPacket tilted(const surface::TexelPacket& packet, int k, int count) {
  const Turn at = turn(k, count);
  const double across = kConeSine * at.cosine, up = kConeSine * at.sine;
  surface::TexelPacket out = packet;
  for (int lane = 0; lane < surface::kLanes; ++lane) {
    if (packet.texel[lane] == surface::kNoTexel) continue;
    const double x = packet.nx[lane], y = packet.ny[lane], z = packet.nz[lane];
    // Two directions across the normal (Duff et al. 2017).
    const double sign = z < 0 ? -1 : 1;
    const double a = -1 / (sign + z), b = x * y * a;
    out.nx[lane] = static_cast<float>(kConeCosine * x + across * (1 + sign * x * x * a) + up * b);
    out.ny[lane] =
        static_cast<float>(kConeCosine * y + across * sign * b + up * (sign + y * y * a));
    out.nz[lane] = static_cast<float>(kConeCosine * z - across * sign * x - up * y);
  }
  return out;
}

namespace {

constexpr float kLeastWindow = 0.5F;  // texels
/// A texel whose surface lies as far away as it looks is e^-0.5 as sure.
constexpr double kDoubtFarAway = 0.5;
/// What rounding leaves of the variance of one colour, at most.
constexpr double kNoVariance = 1e-6;
/// Responses that a packet keeps between the passes.
constexpr std::size_t kMostKept = 2048;

/// In how many directions a texel looks.
std::size_t looks_of(const SplatLimits& limits) {
  return 1 + static_cast<std::size_t>(limits.rays);
}

/// One packet along one of its rays.
struct Look {
  std::size_t at;  ///< into bundles, depths and profiles
  const TexelPacket& packet;
};

/// Calls use(look) for every packet and ray of [first, last).
template <class Use>
void for_looks(const SplatLimits& limits, const SplatState& state, std::size_t first,
               std::size_t last, Use use) {
  std::size_t at = first * looks_of(limits);
  for (std::size_t p = first; p < last; ++p) {
    use(Look{at++, state.packets[p]});
    for (int k = 0; k < limits.rays; ++k) use(Look{at++, tilted(state.packets[p], k, limits.rays)});
  }
}

/// Runs `use` on every packet and ray with the candidates that its group may meet.
template <class Use>
void for_packets(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                 const SplatState& state, const GoOn& go_on, Use use) {
  SplatCandidates candidates(gaussian::count_of(sets));
  const std::size_t looks = looks_of(limits);
  for (const surface::PacketGroup& group : state.groups) {
    const RayBundle all =
        unite(std::span(state.bundles.data() + group.first * looks, group.count * looks));
    float footprint = 0;
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p)
      footprint = std::max(footprint, state.depths[p * looks].footprint);
    candidates.clear();
    kernels.gather(sets, all, limits.reach, footprint, candidates);
    for_looks(limits, state, group.first, group.first + group.count, [&](const Look& look) {
      go_on();
      use(look, candidates);
    });
  }
}

/// Responses of a packet, chunk by chunk, through a buffer of kMostKept.
class Responses {
 public:
  Responses(const SplatLimits& limits, const SplatKernels& kernels, const SplatState& state)
      : limits_(limits), kernels_(kernels), state_(state), buffer_(kMostKept) {}

  /// Calls use(responses) until all were used, and adds them to `profile` if there is one. True if
  /// the last call had all of them: kept() has them then.
  template <class Use>
  bool run(const Look& look, const SplatCandidates& candidates, ProfilePacket* profile, Use use) {
    bool all = true;
    count_ = 0;
    for (std::size_t first = 0; first < candidates.size(); first += kMostResponses) {
      const std::size_t last = std::min(first + kMostResponses, candidates.size());
      if (count_ + (last - first) > kMostKept) {
        use(kept());
        count_ = 0;
        all = false;
      }
      count_ += kernels_.respond(candidates, first, last, state_.bundles[look.at], look.packet,
                                 state_.depths[look.at], limits_, buffer_.data() + count_, profile);
    }
    use(kept());
    return all;
  }
  std::span<const SplatResponse> kept() const { return {buffer_.data(), count_}; }

 private:
  const SplatLimits& limits_;
  const SplatKernels& kernels_;
  const SplatState& state_;
  PageVector<SplatResponse> buffer_;
  std::size_t count_ = 0;
};

void ignore(std::span<const SplatResponse>) {}

/// As the kernel, and keeps what outlives the profile.
void find_surface(const SplatLimits& limits, const SplatKernels& kernels, ProfilePacket& profile,
                  DepthPacket& depths) {
  kernels.find_surface(limits, profile, depths);
  std::copy_n(profile.bins[kProfileBins - 1], kLanes, depths.passed);
}

DepthPacket start_of(const SplatLimits& limits, const TexelPacket& packet) {
  DepthPacket depths{};
  for (int lane = 0; lane < kLanes; ++lane) {
    const float edge = 1 / packet.per_texel[lane];
    const float window = std::max(limits.window, kLeastWindow * edge);
    depths.per_window[lane] = 1 / window;
    depths.per_bin[lane] = 1 / std::max(window / 2, 2 * limits.reach / kDepthBins);
    if (packet.texel[lane] == surface::kNoTexel) continue;
    depths.used |= 1U << lane;
    depths.footprint = std::max(depths.footprint, footprint_of(edge, limits));
  }
  return depths;
}

}  // namespace

void start(const SplatLimits& limits, SplatState& state) {
  const std::size_t looks = state.packets.size() * looks_of(limits);
  state.depths.clear();
  state.depths.reserve(looks);
  state.bundles.clear();
  state.bundles.reserve(looks);
  state.profiles.clear();
  for_looks(limits, state, 0, state.packets.size(), [&](const Look& look) {
    state.depths.push_back(start_of(limits, look.packet));
    state.bundles.push_back(bundle_of(look.packet));
  });
}

std::vector<Box3f> reachable_boxes(const SplatLimits& limits, const SplatState& state,
                                   std::size_t blocks) {
  std::vector<Box3f> boxes(blocks);
  for (std::size_t i = 0; i < state.bundles.size(); ++i) {
    RayBundle bundle = state.bundles[i];  // and how much farther a footprint lets a Gaussian reach
    bundle.offset += gaussian::kSplatCutOff * std::sqrt(state.depths[i].footprint) * 1.0001F;
    boxes[state.packets[i / looks_of(limits)].block].extend(bundle.swept_box(limits.reach));
  }
  return boxes;
}

void blend_whole(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                 SplatState& state, const GoOn& go_on) {
  Responses responses(limits, kernels, state);
  const auto blend = [&](const Look& look, const SplatCandidates& near) {
    ProfilePacket profile{};
    DepthPacket& depths = state.depths[look.at];
    const auto sum = [&](std::span<const SplatResponse> some) {
      kernels.accumulate(some, look.packet, profile, limits, depths);
    };
    const bool kept = responses.run(look, near, &profile, ignore);
    find_surface(limits, kernels, profile, depths);
    if (kept) {
      sum(responses.kept());
    } else {
      responses.run(look, near, nullptr, sum);
    }
  };
  for_packets(sets, limits, kernels, state, go_on, blend);
}

void profile_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                   SplatState& state, const GoOn& go_on) {
  state.profiles.resize(state.depths.size());
  Responses responses(limits, kernels, state);
  const auto profile = [&](const Look& look, const SplatCandidates& near) {
    responses.run(look, near, &state.profiles[look.at], ignore);
  };
  for_packets(sets, limits, kernels, state, go_on, profile);
}

void find_surfaces(const SplatLimits& limits, const SplatKernels& kernels, SplatState& state) {
  for (std::size_t i = 0; i < state.depths.size(); ++i)
    find_surface(limits, kernels, state.profiles[i], state.depths[i]);
}

void sum_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
               SplatState& state, const GoOn& go_on) {
  Responses responses(limits, kernels, state);
  const auto sum = [&](const Look& look, const SplatCandidates& near) {
    responses.run(look, near, nullptr, [&](std::span<const SplatResponse> some) {
      kernels.accumulate(some, look.packet, state.profiles[look.at], limits, state.depths[look.at]);
    });
  };
  for_packets(sets, limits, kernels, state, go_on, sum);
}

namespace {

/// What sixteen texels have found along one of their rays, lane by lane in loops that become
/// vectors: where that is as much as `least` of opacity.
SplatFindings found_along(const SplatLimits& limits, const DepthPacket& depths, double least) {
  SplatFindings out;
  double per_weight[kLanes], square[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    out.opacity[i] = 1 - exp_same(-depths.passed[i] / double{kSplatSteps});
    const bool enough = depths.weight[i] > 0 && out.opacity[i] >= least;
    out.found |= std::uint32_t{enough} << i;
    per_weight[i] = enough ? static_cast<double>(depths.weight[i]) : 1;
    square[i] = static_cast<double>(depths.square[i]) / per_weight[i] - kNoVariance;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    for (int i = 0; i < kLanes; ++i) {
      const double mean = static_cast<double>(depths.colour[c][i]) / per_weight[i];
      out.colour[c][i] = std::min(std::max(mean, 0.0), 1.0);
      square[i] -= out.colour[c][i] * out.colour[c][i];
    }
  }
  for (int i = 0; i < kLanes; ++i) {
    // Places in the profile, 0..1 of all its bins.
    const double bins = kProfileBins / double{depths.per_bin[i]};
    const double place = static_cast<double>(depths.depth[i]) / per_weight[i];
    out.distance[i] = double{limits.reach} - place * bins;
    const double away = std::min(std::abs(out.distance[i]) / double{limits.reach}, 1.0);
    out.confidence[i] =
        out.opacity[i] * exp_same(-std::sqrt(std::max(square[i], 0.0)) - kDoubtFarAway * away);
  }
  return out;
}

}  // namespace

void SplatFindings::take(std::size_t lane, const SplatFindings& from) {
  drop(lane);
  found |= from.found & std::uint32_t{1} << lane;
  for (std::size_t c = 0; c < 3; ++c) colour[c][lane] = from.colour[c][lane];
  opacity[lane] = from.opacity[lane];
  distance[lane] = from.distance[lane];
  confidence[lane] = from.confidence[lane];
}

std::optional<SplatFinding> SplatFindings::operator[](std::size_t lane) const {
  if (!has(lane)) return std::nullopt;
  return SplatFinding{{colour[0][lane], colour[1][lane], colour[2][lane]},
                      opacity[lane],
                      distance[lane],
                      confidence[lane]};
}

SplatFindings findings(const SplatLimits& limits, const SplatState& state, std::size_t packet) {
  const std::size_t own = packet * looks_of(limits);
  SplatFindings out = found_along(limits, state.depths[own], limits.least_opacity);
  for (std::size_t i = 0; i < kLanes; ++i) {
    if (out.confidence[i] < limits.least_confidence) out.drop(i);
  }
  if (limits.rays == 0) return out;
  std::array<double, kLanes> weights{};
  for (std::size_t i = 0; i < kLanes; ++i) {
    if (!out.has(i)) continue;
    weights[i] = out.opacity[i];
    for (auto& c : out.colour) c[i] *= weights[i];
  }
  for (std::size_t k = 1; k < looks_of(limits); ++k) {
    const SplatFindings beside = found_along(limits, state.depths[own + k], kLeastOpacity);
    for (std::size_t i = 0; i < kLanes; ++i) {
      if (!out.has(i) || !beside.has(i)) continue;
      const double weight = kConeCosine * beside.opacity[i];
      for (std::size_t c = 0; c < 3; ++c) out.colour[c][i] += weight * beside.colour[c][i];
      weights[i] += weight;
    }
  }
  for (std::size_t i = 0; i < kLanes; ++i) {
    if (!out.has(i)) continue;
    for (auto& c : out.colour) c[i] /= weights[i];
  }
  return out;
}

std::uint64_t SplatState::scratch_bytes(std::uint64_t splats) {
  return splats * SplatCandidates::kBytes + SplatCandidates::kFixedBytes +
         round_to_pages(kMostKept * sizeof(SplatResponse));
}

// --- a mesh's texels on rays ---------------------------------------------------------------------
//
// The paper's blend: all Gaussians that a texel's ray meets, by alpha and by angle.
//
//   weight = alpha x response x cosine,   colour = sum(weight x colour) / sum(weight)
//
// The response is the largest value of the Gaussian along the ray p + t n, which runs both ways,
// and nothing beyond 3 standard deviations; the cosine is between the texel's normal and the
// Gaussian's, and nothing beyond --max-angle. Distance has no weight, as in the paper: instead a
// texel first looks as far as its grid cell lets it see in the paper, and twice as far only if
// nothing at all was there. So another layer behind the surface is left out where the cell's size
// tells the two apart, and what is found does not depend on --max-distance unless it is the last
// to be asked. Each open point of the paper and its answer: docs/paper.md.
//
// A sum over all has no order, and sums are integers, so Gaussians may come in any batches; a
// texel's reach depends on itself alone. It ends because the reach doubles. Cost: about what one
// pass of the splats' blend costs, 20 ns per Gaussian and texel that meet, 7 of them at sigma 0.5.

namespace {

bool is_open(const RayPacket& sums) {
  return std::any_of(std::begin(sums.reach), std::end(sums.reach),
                     [](float reach) { return reach > 0; });
}

}  // namespace

void start(const RayLimits& limits, RayState& state) {
  state.reach = std::min(limits.first_reach, limits.max_distance);
  state.sums.assign(state.packets.size(), RayPacket{});
  state.bundles.reserve(state.packets.size());
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    const TexelPacket& packet = state.packets[p];
    state.bundles.push_back(bundle_of(packet));
    for (int lane = 0; lane < kLanes; ++lane) {
      if (packet.texel[lane] != surface::kNoTexel) state.sums[p].reach[lane] = state.reach;
    }
  }
  state.open.resize(state.groups.size());
  for (std::uint32_t g = 0; g < state.open.size(); ++g) state.open[g] = g;
}

std::vector<Box3f> open_boxes(const RayState& state, std::size_t blocks) {
  std::vector<Box3f> boxes(blocks);
  for (const std::uint32_t g : state.open) {
    const surface::PacketGroup& group = state.groups[g];
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p)
      boxes[state.packets[p].block].extend(state.bundles[p].swept_box(state.reach * 1.0001F));
  }
  return boxes;
}

void add_batch(SplatSets sets, const RayLimits& limits, const SplatKernels& kernels,
               RayState& state, const GoOn& go_on) {
  SplatCandidates candidates(gaussian::count_of(sets));
  const float height = state.reach * 1.0001F;
  for (const std::uint32_t g : state.open) {
    const surface::PacketGroup& group = state.groups[g];
    const RayBundle all = unite(std::span(state.bundles.data() + group.first, group.count));
    candidates.clear();
    kernels.gather(sets, all, height, 0, candidates);
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      if (!is_open(state.sums[p])) continue;
      go_on();
      kernels.add_met(candidates, state.bundles[p], height, state.packets[p], limits,
                      state.sums[p]);
    }
  }
}

void widen(const RayLimits& limits, RayState& state) {
  const bool is_last = state.reach >= limits.max_distance;
  state.reach = std::min(2 * state.reach, limits.max_distance);
  std::erase_if(state.open, [&](std::uint32_t g) {
    const surface::PacketGroup& group = state.groups[g];
    bool open = false;
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      RayPacket& sums = state.sums[p];
      for (int lane = 0; lane < kLanes; ++lane) {
        if (sums.reach[lane] == 0) continue;
        if (sums.weight[lane] > 0) {
          // From shares of the reach to shares of the maximum distance: a step is worth less.
          const double share = static_cast<double>(sums.reach[lane] / limits.max_distance);
          sums.away[lane] = static_cast<std::int64_t>(static_cast<double>(sums.away[lane]) * share);
        }
        const bool found = sums.weight[lane] > 0;
        sums.reach[lane] = found || is_last ? 0 : state.reach;
      }
      open = open || is_open(sums);
    }
    return !open;
  });
}

std::optional<std::array<double, 4>> ray_colour(const RayPacket& sums, int lane) {
  const std::int64_t weight = sums.weight[lane];
  if (weight <= 0) return std::nullopt;
  std::array<double, 4> out{};
  for (std::size_t c = 0; c < 3; ++c)
    out[c] = static_cast<double>(sums.colour[c][lane]) / static_cast<double>(weight);
  const double alpha = static_cast<double>(weight) / static_cast<double>(sums.plain[lane]);
  constexpr double kNothing = 0x1p-19;  // twice the alpha that unseen texels are stored with
  out[3] = alpha < kNothing ? 0 : std::min(alpha, 1.0);
  return out;
}

void count_distances(const RayState& state, float max_distance, DistanceCounts& counts) {
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    const RayPacket& sums = state.sums[p];
    for (int lane = 0; lane < kLanes; ++lane) {
      if (sums.weight[lane] <= 0) continue;
      const double share =
          static_cast<double>(sums.away[lane]) / static_cast<double>(sums.weight[lane]);
      count_distance(static_cast<float>(share) * max_distance, max_distance, counts);
    }
  }
}

std::uint64_t RayState::scratch_bytes(std::uint64_t splats) {
  return splats * SplatCandidates::kBytes + SplatCandidates::kFixedBytes;
}

}  // namespace pounce::projection
