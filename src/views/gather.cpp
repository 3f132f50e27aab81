// SPDX-License-Identifier: Apache-2.0
#include "views/gather.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "pounce/options.h"

namespace pounce::views {
namespace {

constexpr float kLeastAlpha = 0.5F;

static_assert(kMostViews * std::uint64_t{255} * 65535 <= 0x7FFFFFFF, "sums are of 32 bits");

/// The nearest whole number of one that is not negative.
std::uint32_t rounded(float value) {
  return static_cast<std::uint32_t>(static_cast<std::int32_t>(value + 0.5F));
}

/// The four pixels around a place of a tile, and their shares.
struct Around {
  std::uint32_t first = 0;  ///< of the tile's pixels
  float shares[4];

  /// False: it is not in this tile.
  bool set(float x, float y, const ViewTiles& tiles) {
    const auto low_x = static_cast<std::int32_t>(x), low_y = static_cast<std::int32_t>(y);
    const std::uint32_t in_x = static_cast<std::uint32_t>(low_x) - tiles.tile_x * kTileEdge,
                        in_y = static_cast<std::uint32_t>(low_y) - tiles.tile_y * kTileEdge;
    if (in_x >= kTileEdge || in_y >= kTileEdge) return false;
    const float fx = x - static_cast<float>(low_x), fy = y - static_cast<float>(low_y);
    first = (in_y + kApron) * kStoredEdge + in_x + kApron;
    shares[0] = (1 - fx) * (1 - fy);
    shares[1] = fx * (1 - fy);
    shares[2] = (1 - fx) * fy;
    shares[3] = fx * fy;
    return true;
  }
  std::uint32_t at(int i) const {
    return first + static_cast<std::uint32_t>(i % 2) +
           static_cast<std::uint32_t>(i / 2) * kStoredEdge;
  }
};

/// Is the target's surface, in some of the pixels around, about where the texel is?
bool is_on_target(const SightLimits& limits, const std::uint16_t* target, const Around& around,
                  float depth) {
  for (int i = 0; i < 4; ++i) {
    const std::uint16_t sample = target[around.at(i)];
    if (sample != kNoDepth && std::abs(static_cast<float>(sample) - depth) <= limits.on_target)
      return true;
  }
  return false;
}

using Four = float __attribute__((vector_size(16)));

void add_lane(const SightLimits& limits, const ViewTiles& tiles, const Around& around,
              const PlacePacket& places, int lane, SightPacket& sight) {
  const float depth = places.depth[lane];
  if (!is_on_target(limits, tiles.target, around, depth)) return;
  // Colours are those of what is there: each counts by its alpha.
  Four sum{};  // colour x alpha, alpha
  float before = -1e30F, depths = 0, of_depths = 0;
  for (int i = 0; i < 4; ++i) {
    const std::uint16_t* const s = tiles.scene + std::size_t{around.at(i)} * kSceneSamples;
    const float share = around.shares[i] * static_cast<float>(s[3]);
    sum += share *
           Four{static_cast<float>(s[0]), static_cast<float>(s[1]), static_cast<float>(s[2]), 1};
    if (s[4] == kNoDepth) continue;
    const auto scene = static_cast<float>(s[4]);
    before = std::max(before, depth - scene);
    depths += around.shares[i] * scene;
    of_depths += around.shares[i];
  }
  const float alpha = sum[3];
  if (!(alpha >= kLeastAlpha * kAlphaSteps)) return;
  const auto weight = static_cast<std::uint32_t>(places.weight[lane]);
  SightPacket::Sums& sums = before > limits.hidden ? sight.hidden : sight.clear;
  const float per_alpha = 1 / alpha;
  sums.weight[lane] += weight;
  for (int c = 0; c < 3; ++c) sums.colour[c][lane] += weight * rounded(sum[c] * per_alpha);
  sums.alpha[lane] += weight * rounded(std::min(alpha, kAlphaSteps));
  if (!(of_depths > 0)) return;
  const float away = depth - depths / of_depths, outside = away * places.cosine[lane];
  const auto signed_weight = static_cast<std::int32_t>(weight);
  sums.away[lane] +=
      signed_weight * static_cast<std::int32_t>(outside + (outside < 0 ? -0.5F : 0.5F));
  sums.off[lane] += weight * rounded(std::min(std::abs(away), 65534.0F));
}

}  // namespace

void place(const Grid& grid, std::uint32_t view, const ViewKernels& kernels,
           std::span<const TexelPacket> packets, std::vector<PlacePacket>& places,
           std::span<SightPacket> sights) {
  const auto most = static_cast<std::int32_t>(grid.tiles_across()) - 1;
  // All of a target lies inside a view, so no place is negative.
  const auto tile = [most](float at) {
    return static_cast<std::uint16_t>(
        std::clamp(static_cast<std::int32_t>(at) / kTileEdge, 0, most));
  };
  const Frame& f = grid.frame(view);
  const float per_pixel = 1 / grid.pixel();
  const Seen middle = grid.see(view, grid.middle());
  const PlaceFrame frame{f.right * per_pixel,  f.down * per_pixel, f.forward,
                         grid.middle(),        middle.x,           middle.depth,
                         1 / grid.depth_step()};
  places.resize(packets.size());
  for (std::size_t p = 0; p < packets.size(); ++p) {
    PlacePacket& out = places[p];
    const unsigned facing = kernels.place(frame, packets[p], out);
    out.tiles = {};
    if (facing == 0) continue;
    for (int i = 0; i < kLanes; ++i)
      sights[p].facing[i] += static_cast<std::uint32_t>(out.weight[i]);
    float x0 = 1e30F, x1 = 0, y0 = 1e30F, y1 = 0;
    for (unsigned left = facing; left != 0; left &= left - 1) {
      const int i = std::countr_zero(left);
      x0 = std::min(x0, out.x[i]);
      x1 = std::max(x1, out.x[i]);
      y0 = std::min(y0, out.y[i]);
      y1 = std::max(y1, out.y[i]);
    }
    out.tiles = {tile(x0), tile(x1), tile(y0), tile(y1)};
  }
}

void gather(const SightLimits& limits, const ViewTiles& tiles, std::span<const PlacePacket> places,
            std::span<SightPacket> sights) {
  for (std::size_t p = 0; p < places.size(); ++p) {
    const TileRange& range = places[p].tiles;
    if (range.empty() || tiles.tile_x < range.x0 || tiles.tile_x > range.x1 ||
        tiles.tile_y < range.y0 || tiles.tile_y > range.y1)
      continue;
    Around around;
    for (int lane = 0; lane < kLanes; ++lane) {
      if (places[p].weight[lane] > 0 && around.set(places[p].x[lane], places[p].y[lane], tiles))
        add_lane(limits, tiles, around, places[p], lane, sights[p]);
    }
  }
}

std::vector<std::uint32_t> leave_unseen(std::span<const surface::PacketGroup> groups,
                                        std::span<const TexelPacket> packets,
                                        std::span<const SightPacket> sights,
                                        projection::SplatState& rays) {
  const auto is_seen = [&](std::size_t p, int lane) {
    return sights[p].clear.weight[lane] > 0 || sights[p].hidden.weight[lane] > 0;
  };
  const auto is_left = [&](std::size_t p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (packets[p].texel[lane] != surface::kNoTexel && !is_seen(p, lane)) return true;
    }
    return false;
  };
  std::size_t count = 0;
  for (std::size_t p = 0; p < packets.size(); ++p) count += is_left(p) ? 1 : 0;
  rays.packets.reserve(count);
  std::vector<std::uint32_t> places(packets.size());
  for (const surface::PacketGroup& group : groups) {
    surface::PacketGroup left{static_cast<std::uint32_t>(rays.packets.size()), 0};
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      if (!is_left(p)) continue;
      TexelPacket packet = packets[p];
      for (int lane = 0; lane < kLanes; ++lane) {
        if (!is_seen(p, lane)) continue;
        packet.texel[lane] = surface::kNoTexel;  // as unused lanes are
        packet.nx[lane] = packet.ny[lane] = packet.nz[lane] = 0;
      }
      places[p] = static_cast<std::uint32_t>(rays.packets.size());
      rays.packets.push_back(packet);
      ++left.count;
    }
    if (left.count > 0) rays.groups.push_back(left);
  }
  return places;
}

std::optional<Sight> sight_of(const Grid& grid, const SightLimits& limits,
                              const SightPacket& packet, int lane) {
  const bool is_clear = packet.clear.weight[lane] > 0;
  const SightPacket::Sums& sums = is_clear ? packet.clear : packet.hidden;
  const auto weight = static_cast<double>(sums.weight[lane]);
  if (!(weight > 0)) return std::nullopt;
  const auto mean = [&](const auto& sum) { return static_cast<double>(sum[lane]) / weight; };
  Sight out;
  for (std::size_t c = 0; c < 3; ++c) out.colour[c] = mean(sums.colour[c]) / double{kColourSteps};
  out.alpha = mean(sums.alpha) / double{kAlphaSteps};
  out.distance = mean(sums.away) * double{grid.depth_step()};
  // How much of what might see it does, and how near the scene is to where it should be. What is
  // seen at all is a colour of the scene.
  constexpr double kLeast = 0.1;
  const double seen = std::min(weight / static_cast<double>(packet.facing[lane]), 1.0);
  const double off = mean(sums.off) / double{limits.hidden};
  out.confidence = kLeast + (1 - kLeast) * (is_clear ? 1.0 : 0.25) * seen / (1 + 4 * off * off);
  return out;
}

}  // namespace pounce::views
