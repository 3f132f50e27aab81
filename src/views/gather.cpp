// SPDX-License-Identifier: Apache-2.0
#include "views/gather.h"

#include <algorithm>
#include <bit>

#include "pounce/options.h"

namespace pounce::views {
namespace {

static_assert(kMostViews * std::uint64_t{255} * 65535 <= 0x7FFFFFFF &&
                  kMostViews * std::uint64_t{255} * 255 * 255 <= 0x7FFFFFFF,
              "sums are of 32 bits");
// A texel faces half of the views, about: twice, from outside and inside, is no more than all once.

}  // namespace

void place(const Grid& grid, std::uint32_t view, const ViewKernels& kernels,
           std::span<const TexelPacket> packets, std::vector<PlacePacket>& places,
           std::span<SightPacket> sights) {
  const Frame& f = grid.frame(view);
  const float per_pixel = 1 / grid.pixel();
  const Seen middle = grid.see(view, grid.middle());
  const PlaceFrame frame{f.right * per_pixel,
                         f.down * per_pixel,
                         f.forward,
                         grid.middle(),
                         middle.x,
                         middle.depth,
                         1 / grid.depth_step(),
                         static_cast<std::int32_t>(grid.tiles_across()) - 1};
  places.resize(packets.size());
  kernels.place(frame, packets, places, sights);
}

namespace {

bool is_seen(const SightPacket& sights, int lane) {
  return sights.clear.weight[lane] > 0 || sights.hidden.weight[lane] > 0;
}

bool has_unseen(const TexelPacket& packet, const SightPacket& sights) {
  for (int lane = 0; lane < kLanes; ++lane) {
    if (packet.texel[lane] != surface::kNoTexel && !is_seen(sights, lane)) return true;
  }
  return false;
}

/// As unused lanes are.
void drop_lane(TexelPacket& packet, int lane) {
  packet.texel[lane] = surface::kNoTexel;
  packet.nx[lane] = packet.ny[lane] = packet.nz[lane] = 0;
}

}  // namespace

bool drop_clear(std::span<TexelPacket> packets, std::span<SightPacket> sights) {
  bool any = false;
  for (std::size_t p = 0; p < packets.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (packets[p].texel[lane] == surface::kNoTexel) continue;
      if (sights[p].clear.weight[lane] > 0) {
        drop_lane(packets[p], lane);
      } else {
        sights[p].facing[lane] = 0;
        any = true;
      }
    }
  }
  return any;
}

std::size_t count_unseen(std::span<const TexelPacket> packets,
                         std::span<const SightPacket> sights) {
  std::size_t count = 0;
  for (std::size_t p = 0; p < packets.size(); ++p)
    count += has_unseen(packets[p], sights[p]) ? 1 : 0;
  return count;
}

void leave_unseen(std::span<const surface::PacketGroup> groups,
                  std::span<const TexelPacket> packets, std::span<const SightPacket> sights,
                  std::span<std::uint32_t> places, projection::SplatState& rays) {
  for (const surface::PacketGroup& group : groups) {
    surface::PacketGroup left{static_cast<std::uint32_t>(rays.packets.size()), 0};
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      if (!has_unseen(packets[p], sights[p])) continue;
      TexelPacket packet = packets[p];
      for (int lane = 0; lane < kLanes; ++lane) {
        if (is_seen(sights[p], lane)) drop_lane(packet, lane);
      }
      places[p] = static_cast<std::uint32_t>(rays.packets.size());
      rays.packets.push_back(packet);
      ++left.count;
    }
    if (left.count > 0) rays.groups.push_back(left);
  }
}

namespace {

/// Of lanes that no view sees unhidden, the sums of those in which the scene hides them.
void add_hidden(const SightPacket& packet, SightPacket::Sums& sums) {
  const auto add = [&](std::int32_t* to, const std::int32_t* hidden) {
    for (int i = 0; i < kLanes; ++i) to[i] = packet.clear.weight[i] > 0 ? to[i] : hidden[i];
  };
  add(sums.weight, packet.hidden.weight);
  for (std::size_t c = 0; c < 3; ++c) add(sums.colour[c], packet.hidden.colour[c]);
  add(sums.alpha, packet.hidden.alpha);
  add(sums.luma, packet.hidden.luma);
  add(sums.luma_squares, packet.hidden.luma_squares);
  add(sums.away, packet.hidden.away);
  add(sums.off, packet.hidden.off);
}

bool is_hidden_somewhere(const SightPacket& packet) {
  bool out = false;
  for (int i = 0; i < kLanes; ++i)
    out |= packet.clear.weight[i] == 0 && packet.hidden.weight[i] > 0;
  return out;
}

}  // namespace

projection::SplatFindings sights_of(const Grid& grid, const SightLimits& limits,
                                    const SightPacket& packet) {
  // Lane by lane in loops that become vectors.
  SightPacket::Sums with_hidden;
  const bool is_hidden = is_hidden_somewhere(packet);
  if (is_hidden) add_hidden(packet, with_hidden = packet.clear);
  const SightPacket::Sums& sums = is_hidden ? with_hidden : packet.clear;
  projection::SplatFindings out;
  double weight[kLanes], per_weight[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    weight[i] = sums.weight[i];
    out.found |= std::uint32_t{sums.weight[i] > 0} << i;
  }
  for (int i = 0; i < kLanes; ++i) per_weight[i] = 1 / std::max(weight[i], 1.0);
  const auto mean = [&](const std::int32_t* sum, int i) { return sum[i] * per_weight[i]; };
  // How much of what might see it does, how near the scene is to where it should be, and how far
  // its views agree.
  constexpr double kLeast = kLeastConfidence, kUnlike = 0.05;
  constexpr double kSquare = kUnlike * kUnlike * double{kLumaSteps} * double{kLumaSteps};
  if (!limits.tells_confidence) std::fill_n(out.confidence, kLanes, kLeast);
  for (int i = 0; i < kLanes && limits.tells_confidence; ++i) {
    const double seen = std::min(weight[i] / std::max<double>(packet.facing[i], 1), 1.0);
    const double off = mean(sums.off, i) / double{limits.hidden};
    const double luma = mean(sums.luma, i), squares = mean(sums.luma_squares, i),
                 unlike = std::max(squares - luma * luma, 0.0) / kSquare;
    const double most = packet.clear.weight[i] > 0 ? 1.0 : 0.25;
    out.confidence[i] = kLeast + (1 - kLeast) * most * seen / ((1 + 4 * off * off) * (1 + unlike));
  }
  for (std::size_t c = 0; c < 3; ++c) {
    for (int i = 0; i < kLanes; ++i)
      out.colour[c][i] = mean(sums.colour[c], i) * (1 / double{kColourSteps});
  }
  for (int i = 0; i < kLanes; ++i) {
    out.opacity[i] = mean(sums.alpha, i) * (1 / double{kAlphaSteps});
    out.distance[i] = mean(sums.away, i) * double{grid.depth_step()};
  }
  return out;
}

}  // namespace pounce::views
