// SPDX-License-Identifier: Apache-2.0
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
#include "projection/ray_blend.h"

#include <algorithm>
#include <cmath>

#include "projection/packet_bundle.h"
#include "projection/search.h"

namespace pounce::projection {
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
    for (const gaussian::SplatSet* set : sets) kernels.gather(*set, all, height, 0, candidates);
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
