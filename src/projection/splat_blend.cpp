// SPDX-License-Identifier: Apache-2.0
//
// Splats onto texels: which depth is the surface at, and what colour has it there?
//
// A texel's answer is an average of the Gaussians that its normal meets, both ways. Each weighs
// opacity x planarity x needle factor x cos^2 x response (splat_kernels.inl), and a window in depth
// keeps out what lies behind and before: exp(-(t - t0)^2 / 2 w^2), nothing beyond 3 w. All of it is
// sums and no order, so Gaussians may come in any batches.
//
// The window's centre t0 is where the surface is, and one Gaussian does not tell: the nearest one
// is as likely a floater. So weights are counted by depth in bins of the window's width w; a bin
// with its neighbours (1 2 1) says how much surface there is. The needle factor is left out there:
// a needle's colour is worth little, but it lies in its surface like any other Gaussian. t0 is the
// nearest peak with 0.35 of what the highest bin has, or with 0.7 of an opaque, flat Gaussian's
// worth, refined by a parabola. Bins reach 16 w both ways; a texel with no half of a Gaussian there
// doubles w and looks again, until it has looked as far as the maximum distance; what there is
// counts then. Measured against other centres in docs/decisions/011-splat-blend.md.
//
// Profiles are clamped sums of integers and sums are integers, so nothing depends on order. A
// texel's heights depend on itself alone. It ends because w doubles.
//
// Two passes over the Gaussians, profile and sum. Where all that a height may meet is at hand, each
// packet keeps its responses from the first for the second.
#include "projection/splat_blend.h"

#include <algorithm>
#include <cmath>

#include "projection/distance_counts.h"
#include "projection/packet_bundle.h"

namespace pounce::projection {
namespace {

constexpr float kLeastWidth = 0.5F;  // texels
/// S(i) = p(i - 1) + 2 p(i) + p(i + 1) counts a Gaussian in the middle of bin i twice.
constexpr std::int32_t worth(float gaussians) {
  return static_cast<std::int32_t>(2 * gaussians * kProfileSteps);
}
constexpr std::int32_t kSurface = worth(0.5F);  // a height with less has no surface
constexpr std::int32_t kEnough = worth(0.7F);   // a peak that need not be compared with others
/// Gaussians may lie this many widths from the texel and matter: the outermost centre, refined by
/// half a bin, and its window. The neighbours of its bin are nearer.
constexpr float kReach = kDepthBins + 0.5F + kWindowReach;
/// Responses that a packet keeps between the passes.
constexpr std::size_t kMostKept = 512;

/// Width of a lane's bins at the state's height, in texels.
float width_of(const SplatLimits& limits, const TexelPacket& packet, int lane, int height) {
  return std::ldexp(std::max(limits.window * packet.per_texel[lane], kLeastWidth), height);
}

/// How far along its rays a packet looks, in space.
float reach_of(const SplatLimits& limits, const TexelPacket& packet, int height) {
  float reach = 0;
  for (int lane = 0; lane < kLanes; ++lane) {
    const float edge = 1 / packet.per_texel[lane];
    const float width = width_of(limits, packet, lane, height) * edge;
    // A centre lies within the maximum distance, but for half a bin.
    reach = std::max(reach,
                     std::min(kReach * width, limits.max_distance + (0.5F + kWindowReach) * width));
  }
  return reach * 1.0001F;
}

float group_reach(const SplatState& state, const target::PacketGroup& group) {
  return *std::max_element(state.reaches.begin() + group.first,
                           state.reaches.begin() + group.first + group.count);
}

/// One lane's profile, smoothed.
class Profile {
 public:
  Profile(const ProfilePacket& packet, int lane) : packet_(packet), lane_(lane) {}

  std::int32_t at(int i) const { return bin(i - 1) + 2 * bin(i) + bin(i + 1); }
  bool is_peak(int i) const { return at(i) >= at(i - 1) && at(i) >= at(i + 1); }
  std::int32_t highest(int most) const {
    std::int32_t top = 0;
    for (int i = -most; i <= most; ++i) top = std::max(top, at(i));
    return top;
  }

  /// The nearest peak of at least `least` within `most` bins, in bins from the texel.
  std::optional<float> nearest(int most, std::int32_t least) const {
    for (int i = 0; i <= most; ++i) {
      const bool front = at(i) >= least && is_peak(i), back = at(-i) >= least && is_peak(-i);
      if (front || back) return refined(front && (!back || at(i) >= at(-i)) ? i : -i);
    }
    return std::nullopt;
  }

  /// A bin within `most` that is as high as any: for profiles that only rise at their end.
  float nearest_highest(int most) const {
    const std::int32_t top = highest(most);
    for (int i = 0; i <= most; ++i) {
      if (at(i) == top) return static_cast<float>(i);
      if (at(-i) == top) return static_cast<float>(-i);
    }
    return 0;
  }

 private:
  std::int32_t bin(int i) const { return packet_.bins[kMiddleBin + i][lane_]; }
  float refined(int i) const {
    const double before = at(i - 1), here = at(i), after = at(i + 1);
    const double curve = before - 2 * here + after;
    return static_cast<float>(curve < 0 ? i + 0.5 * (before - after) / curve : i);
  }

  const ProfilePacket& packet_;
  int lane_;
};

/// What a peak must have to be the surface where the highest bin has `top`: 0.35 of it, rounded up.
std::int32_t least_peak(std::int32_t top) {
  return static_cast<std::int32_t>(
      std::min<std::int64_t>(kEnough, (top * std::int64_t{7} + 19) / 20));
}

/// Where the lanes that are open have their surface.
void find_centres_of(const SplatLimits& limits, int height, const TexelPacket& packet,
                     const ProfilePacket& profile, DepthPacket& depths) {
  for (int lane = 0; lane < kLanes; ++lane) {
    if ((depths.open >> lane & 1) == 0) continue;
    const float width = width_of(limits, packet, lane, height);
    const float bins = limits.max_distance * packet.per_texel[lane] / width;
    const bool is_last = bins <= kDepthBins;
    const int most = is_last ? static_cast<int>(bins) : kDepthBins;
    const Profile lane_profile(profile, lane);
    const std::int32_t top = lane_profile.highest(most);
    std::optional<float> centre;
    if (top >= (is_last ? 1 : kSurface)) centre = lane_profile.nearest(most, least_peak(top));
    if (top > 0 && is_last && !centre) centre = lane_profile.nearest_highest(most);
    if (centre) {
      depths.centre[lane] = *centre * width;
      depths.take[lane] = 1;
    }
    if (centre || is_last) depths.open &= ~(1U << lane);
  }
}

bool takes(const DepthPacket& depths) {
  return std::any_of(std::begin(depths.take), std::end(depths.take),
                     [](float take) { return take > 0; });
}

/// Runs `use` on every packet of the open groups with the candidates that its group may meet.
template <class Use>
void for_packets(SplatSets sets, const SplatKernels& kernels, const SplatState& state, Use use) {
  SplatCandidates candidates;
  for (const std::uint32_t g : state.open) {
    const target::PacketGroup& group = state.groups[g];
    const RayBundle all = unite(std::span(state.bundles.data() + group.first, group.count));
    const float reach = group_reach(state, group);
    candidates.clear();
    for (const source::SplatSet* set : sets) kernels.gather(*set, all, reach, candidates);
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) use(p, candidates);
  }
}

/// Responses of a packet, chunk by chunk, through a buffer of kMostKept.
class Responses {
 public:
  Responses(const SplatLimits& limits, const SplatKernels& kernels, const SplatState& state)
      : limits_(limits), kernels_(kernels), state_(state), buffer_(kMostKept) {}

  /// Calls use(responses) until all were used. True if the last call had all of them: kept() has
  /// them then.
  template <class Use>
  bool run(std::uint32_t p, const SplatCandidates& candidates, Use use) {
    const TexelPacket& packet = state_.packets[p];
    const float reach = state_.reaches[p];
    bool all = true;
    count_ = 0;
    for (std::size_t first = 0; first < candidates.size(); first += kMostResponses) {
      const std::size_t last = std::min(first + kMostResponses, candidates.size());
      if (count_ + (last - first) > kMostKept) {
        use(kept());
        count_ = 0;
        all = false;
      }
      count_ += kernels_.respond(candidates, first, last, state_.bundles[p], reach, packet, limits_,
                                 buffer_.data() + count_);
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

void set_widths(const SplatLimits& limits, SplatState& state) {
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    DepthPacket& depths = state.depths[p];
    for (int lane = 0; lane < kLanes; ++lane) {
      depths.per_width[lane] = 1 / width_of(limits, state.packets[p], lane, state.height);
      depths.take[lane] = 0;
    }
    state.reaches[p] = reach_of(limits, state.packets[p], state.height);
  }
}

}  // namespace

void start(const SplatLimits& limits, SplatState& state) {
  state.height = 0;
  state.depths.assign(state.packets.size(), DepthPacket{});
  state.profiles.assign(state.packets.size(), ProfilePacket{});
  state.reaches.resize(state.packets.size());
  state.bundles.reserve(state.packets.size());
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    const TexelPacket& packet = state.packets[p];
    RayBundle bundle = bundle_of(packet);
    float edge = 0;
    for (int lane = 0; lane < kLanes; ++lane) {
      edge = std::max(edge, 1 / packet.per_texel[lane]);
      if (packet.texel[lane] != target::kNoTexel) state.depths[p].open |= 1U << lane;
    }
    // A footprint lets a Gaussian reach 3 sqrt(f) farther.
    bundle.offset += source::kSplatCutOff * std::sqrt(kFootprint) * edge * 1.0001F;
    state.bundles.push_back(bundle);
  }
  set_widths(limits, state);
  state.open.resize(state.groups.size());
  for (std::uint32_t g = 0; g < state.open.size(); ++g) state.open[g] = g;
}

std::vector<Box3f> open_boxes(const SplatState& state, std::size_t blocks) {
  std::vector<Box3f> boxes(blocks);
  for (const std::uint32_t g : state.open) {
    const target::PacketGroup& group = state.groups[g];
    const float reach = group_reach(state, group);
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p)
      boxes[state.packets[p].block].extend(state.bundles[p].swept_box(reach));
  }
  return boxes;
}

void blend_height(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                  SplatState& state) {
  Responses responses(limits, kernels, state);
  for_packets(sets, kernels, state, [&](std::uint32_t p, const SplatCandidates& near) {
    DepthPacket& depths = state.depths[p];
    if (depths.open == 0) return;
    ProfilePacket& profile = state.profiles[p];
    profile = {};
    const bool kept = responses.run(p, near, [&](std::span<const SplatResponse> some) {
      kernels.deposit(some, depths, profile);
    });
    find_centres_of(limits, state.height, state.packets[p], profile, depths);
    if (!takes(depths)) return;
    const auto sum = [&](std::span<const SplatResponse> some) {
      kernels.accumulate(some, state.packets[p], depths);
    };
    if (kept) {
      sum(responses.kept());
    } else {
      responses.run(p, near, sum);
    }
  });
}

void profile_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
                   SplatState& state) {
  Responses responses(limits, kernels, state);
  for_packets(sets, kernels, state, [&](std::uint32_t p, const SplatCandidates& near) {
    if (state.depths[p].open == 0) return;
    responses.run(p, near, [&](std::span<const SplatResponse> some) {
      kernels.deposit(some, state.depths[p], state.profiles[p]);
    });
  });
}

void find_centres(const SplatLimits& limits, SplatState& state) {
  for (std::size_t p = 0; p < state.packets.size(); ++p)
    find_centres_of(limits, state.height, state.packets[p], state.profiles[p], state.depths[p]);
}

void sum_batch(SplatSets sets, const SplatLimits& limits, const SplatKernels& kernels,
               SplatState& state) {
  Responses responses(limits, kernels, state);
  for_packets(sets, kernels, state, [&](std::uint32_t p, const SplatCandidates& near) {
    if (!takes(state.depths[p])) return;
    responses.run(p, near, [&](std::span<const SplatResponse> some) {
      kernels.accumulate(some, state.packets[p], state.depths[p]);
    });
  });
}

void next_height(const SplatLimits& limits, SplatState& state) {
  std::erase_if(state.open, [&](std::uint32_t g) {
    const target::PacketGroup& group = state.groups[g];
    return std::all_of(state.depths.begin() + group.first,
                       state.depths.begin() + group.first + group.count,
                       [](const DepthPacket& depths) { return depths.open == 0; });
  });
  ++state.height;
  set_widths(limits, state);
  if (!state.open.empty()) state.profiles.assign(state.packets.size(), ProfilePacket{});
}

std::optional<std::array<double, 3>> splat_colour(const DepthPacket& depths, int lane) {
  const std::int64_t weight = depths.weight[lane];
  if (weight <= 0) return std::nullopt;
  std::array<double, 3> out{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double value = static_cast<double>(depths.colour[c][lane]) / static_cast<double>(weight);
    out[c] = std::clamp(value, 0.0, 1.0);
  }
  return out;
}

void count_distances(const SplatState& state, float max_distance, DistanceCounts& counts) {
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    const DepthPacket& depths = state.depths[p];
    for (int lane = 0; lane < kLanes; ++lane) {
      if (state.packets[p].texel[lane] == target::kNoTexel || depths.weight[lane] <= 0) continue;
      const float distance = std::abs(depths.centre[lane]) / state.packets[p].per_texel[lane];
      count_distance(distance, max_distance, counts);
    }
  }
}

std::uint64_t SplatState::scratch_bytes(std::uint64_t splats) {
  return splats * SplatCandidates::kBytes + round_to_pages(kMostKept * sizeof(SplatResponse)) +
         8 * kPageBytes;
}

}  // namespace pounce::projection
