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
// Profiles and sums are clamped sums of integers, so Gaussians may come in any order and batches.
//
// Two passes over the Gaussians, profile and sum. Where all that a piece may meet is at hand, each
// packet keeps its responses from the first for the second.
#include "projection/splat_blend.h"

#include <algorithm>
#include <cmath>

#include "core/exp.h"
#include "projection/distance_counts.h"
#include "projection/packet_bundle.h"

namespace pounce::projection {
namespace {

constexpr float kLeastWindow = 0.5F;  // texels
/// Responses that a packet keeps between the passes.
constexpr std::size_t kMostKept = 512;

/// Runs `use` on every packet with the candidates that its group may meet.
template <class Use>
void for_packets(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                 const SplatState& state, Use use) {
  SplatCandidates candidates;
  for (const target::PacketGroup& group : state.groups) {
    const RayBundle all = unite(std::span(state.bundles.data() + group.first, group.count));
    float footprint = 0;
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p)
      footprint = std::max(footprint, state.depths[p].footprint);
    candidates.clear();
    for (const source::SplatSet* set : sets)
      kernels.gather(*set, all, limits.reach, footprint, candidates);
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) use(p, candidates);
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
  bool run(std::uint32_t p, const SplatCandidates& candidates, ProfilePacket* profile, Use use) {
    bool all = true;
    count_ = 0;
    for (std::size_t first = 0; first < candidates.size(); first += kMostResponses) {
      const std::size_t last = std::min(first + kMostResponses, candidates.size());
      if (count_ + (last - first) > kMostKept) {
        use(kept());
        count_ = 0;
        all = false;
      }
      count_ += kernels_.respond(candidates, first, last, state_.bundles[p], state_.packets[p],
                                 state_.depths[p], limits_, buffer_.data() + count_, profile);
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

DepthPacket start_of(const SplatLimits& limits, const TexelPacket& packet) {
  DepthPacket depths{};
  for (int lane = 0; lane < kLanes; ++lane) {
    const float edge = 1 / packet.per_texel[lane];
    const float window = std::max(limits.window, kLeastWindow * edge);
    depths.per_window[lane] = 1 / window;
    depths.per_bin[lane] = 1 / std::max(window / 2, 2 * limits.reach / kDepthBins);
    if (packet.texel[lane] == target::kNoTexel) continue;
    depths.used |= 1U << lane;
    depths.footprint = std::max(depths.footprint, kFootprint * edge * edge);
  }
  return depths;
}

}  // namespace

void start(const SplatLimits& limits, SplatState& state) {
  state.depths.clear();
  state.depths.reserve(state.packets.size());
  state.bundles.clear();
  state.bundles.reserve(state.packets.size());
  state.profiles.assign(state.packets.size(), ProfilePacket{});
  for (const TexelPacket& packet : state.packets) {
    state.depths.push_back(start_of(limits, packet));
    state.bundles.push_back(bundle_of(packet));
  }
}

std::vector<Box3f> reachable_boxes(const SplatLimits& limits, const SplatState& state,
                                   std::size_t blocks) {
  std::vector<Box3f> boxes(blocks);
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    RayBundle bundle = state.bundles[p];  // and how much farther a footprint lets a Gaussian reach
    bundle.offset += source::kSplatCutOff * std::sqrt(state.depths[p].footprint) * 1.0001F;
    boxes[state.packets[p].block].extend(bundle.swept_box(limits.reach));
  }
  return boxes;
}

void blend_whole(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                 SplatState& state) {
  Responses responses(limits, kernels, state);
  for_packets(sets, limits, kernels, state, [&](std::uint32_t p, const SplatCandidates& near) {
    ProfilePacket& profile = state.profiles[p];
    const auto sum = [&](std::span<const SplatResponse> some) {
      kernels.accumulate(some, state.packets[p], profile, limits, state.depths[p]);
    };
    const bool kept = responses.run(p, near, &profile, ignore);
    kernels.find_surface(limits, profile, state.depths[p]);
    if (kept) {
      sum(responses.kept());
    } else {
      responses.run(p, near, nullptr, sum);
    }
  });
}

void profile_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                   SplatState& state) {
  Responses responses(limits, kernels, state);
  for_packets(sets, limits, kernels, state, [&](std::uint32_t p, const SplatCandidates& near) {
    responses.run(p, near, &state.profiles[p], ignore);
  });
}

void find_surfaces(const SplatLimits& limits, const SplatKernels& kernels, SplatState& state) {
  for (std::size_t p = 0; p < state.packets.size(); ++p)
    kernels.find_surface(limits, state.profiles[p], state.depths[p]);
}

void sum_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
               SplatState& state) {
  Responses responses(limits, kernels, state);
  for_packets(sets, limits, kernels, state, [&](std::uint32_t p, const SplatCandidates& near) {
    responses.run(p, near, nullptr, [&](std::span<const SplatResponse> some) {
      kernels.accumulate(some, state.packets[p], state.profiles[p], limits, state.depths[p]);
    });
  });
}

std::optional<SplatFinding> finding(const SplatLimits& limits, const SplatState& state,
                                    std::size_t packet, int lane) {
  const DepthPacket& depths = state.depths[packet];
  const double weight = depths.weight[lane];
  if (weight <= 0) return std::nullopt;
  SplatFinding out;
  const double passed = state.profiles[packet].bins[kProfileBins - 1][lane];
  out.opacity = 1 - exp_same(-passed / double{kSplatSteps});
  if (out.opacity < limits.least_opacity) return std::nullopt;
  for (std::size_t c = 0; c < 3; ++c)
    out.colour[c] = std::clamp(depths.colour[c][lane] / weight, 0.0, 1.0);
  // Places in the profile, 0..1 of all its bins.
  const double bins = kProfileBins / double{depths.per_bin[lane]};
  const double place = depths.depth[lane] / weight, square = depths.spread[lane] / weight;
  out.distance = double{limits.reach} - place * bins;
  out.spread = std::sqrt(std::max(square - place * place, 0.0)) * bins;
  return out;
}

void count_distances(const SplatLimits& limits, const SplatState& state, DistanceCounts& counts) {
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (state.packets[p].texel[lane] == target::kNoTexel) continue;
      if (const auto found = finding(limits, state, p, lane)) {
        count_distance(static_cast<float>(std::abs(found->distance)), limits.reach, counts);
      }
    }
  }
}

std::uint64_t SplatState::scratch_bytes(std::uint64_t splats) {
  return splats * SplatCandidates::kBytes + round_to_pages(kMostKept * sizeof(SplatResponse)) +
         8 * kPageBytes;
}

}  // namespace pounce::projection
