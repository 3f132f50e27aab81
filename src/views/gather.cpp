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

projection::SplatFindings sights_of(const Grid& grid, const SightLimits& limits,
                                    const SightPacket& packet) {
  // Lane by lane in loops that become vectors.
  const auto sums = [&](const auto& member, int lane) {
    return static_cast<double>(packet.clear.weight[lane] > 0 ? (packet.clear.*member)[lane]
                                                             : (packet.hidden.*member)[lane]);
  };
  double weight[kLanes], per_weight[kLanes], confidence[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    weight[i] = sums(&SightPacket::Sums::weight, i);
    per_weight[i] = 1 / std::max(weight[i], 1.0);
  }
  // How much of what might see it does, how near the scene is to where it should be, and how far
  // its views agree. What is seen at all is a colour of the scene.
  constexpr double kLeast = 0.1, kUnlike = 0.05;
  constexpr double kSquare = kUnlike * kUnlike * double{kLumaSteps} * double{kLumaSteps};
  for (int i = 0; i < kLanes; ++i) {
    const double seen = std::min(weight[i] / std::max<double>(packet.facing[i], 1), 1.0);
    const double off = sums(&SightPacket::Sums::off, i) * per_weight[i] / double{limits.hidden};
    const double luma = sums(&SightPacket::Sums::luma, i) * per_weight[i],
                 squares = sums(&SightPacket::Sums::luma_squares, i) * per_weight[i],
                 unlike = std::max(squares - luma * luma, 0.0) / kSquare;
    const double most = packet.clear.weight[i] > 0 ? 1.0 : 0.25;
    confidence[i] = kLeast + (1 - kLeast) * most * seen / ((1 + 4 * off * off) * (1 + unlike));
  }
  projection::SplatFindings out;
  for (int i = 0; i < kLanes; ++i) {
    if (weight[i] == 0) continue;
    projection::SplatFinding& found = out[static_cast<std::size_t>(i)].emplace();
    const SightPacket::Sums& own = packet.clear.weight[i] > 0 ? packet.clear : packet.hidden;
    for (std::size_t c = 0; c < 3; ++c)
      found.colour[c] = own.colour[c][i] * per_weight[i] * (1 / double{kColourSteps});
    found.opacity = own.alpha[i] * per_weight[i] * (1 / double{kAlphaSteps});
    found.distance = own.away[i] * per_weight[i] * double{grid.depth_step()};
    found.confidence = confidence[i];
  }
  return out;
}

}  // namespace pounce::views
