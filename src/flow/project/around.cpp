// SPDX-License-Identifier: Apache-2.0
#include "flow/project/around.h"

#include <algorithm>
#include <memory>
#include <vector>

#include "flow/project/pieces.h"

namespace pounce::flow {
namespace {

/// Of the scene's views what one look at them needs.
struct Look {
  const SceneViews& views;
  const views::SightLimits& limits;
  bool backwards;
};

/// The views' tiles of the scene or of the target.
struct Tiles {
  const ColourCache& cache;
  std::span<const store::ChunkRef> places;  ///< of all; none: the cache knows
};

/// Where a row of tiles is.
class TileRow {
 public:
  TileRow(const Tiles& tiles, std::uint32_t row, std::size_t across) {
    if (tiles.places.empty()) held_ = tiles.cache.index(row);
    places_ = held_ != nullptr ? std::span(*held_) : tiles.places.subspan(row * across, across);
  }
  const store::ChunkRef& operator[](std::size_t x) const { return places_[x]; }

 private:
  std::shared_ptr<const ColourCache::Index> held_;
  std::span<const store::ChunkRef> places_;
};

void look_around(const Look& look, const Tiles& of_scene, const Tiles& of_target,
                 std::span<const surface::TexelPacket> packets,
                 std::span<views::SightPacket> sights) {
  const SceneViews& views = look.views;
  std::vector<views::PlacePacket> places;
  const std::uint32_t across = views.grid.tiles_across(), last_view = views.grid.views() - 1;
  std::vector<char> tiles(std::size_t{across} * across);  // of a view: some texel may lie there
  for (std::uint32_t i = 0; i <= last_view; ++i) {
    const std::uint32_t view = look.backwards ? last_view - i : i;
    views::place(views.grid, view, *views.kernels, packets, places, sights);
    std::fill(tiles.begin(), tiles.end(), false);
    for (std::size_t p = 0; p < places.size(); p += places[p].alike) {
      const views::TileRange& range = places[p].tiles;
      if (range.empty()) continue;
      for (std::uint32_t y = range.y0; y <= range.y1; ++y) {
        for (std::uint32_t x = range.x0; x <= range.x1; ++x)
          tiles[y * std::size_t{across} + x] = true;
      }
    }
    for (std::uint32_t y = 0; y < across; ++y) {
      const auto asked = std::span(tiles).subspan(y * std::size_t{across}, across);
      if (std::find(asked.begin(), asked.end(), true) == asked.end()) continue;
      const std::uint32_t row = views.grid.tile_row(view, y);
      const TileRow of_row(of_scene, row, across), target_of_row(of_target, row, across);
      for (std::uint32_t x = 0; x < across; ++x) {
        // Where there is nothing of the one or the other, no texel is seen.
        const store::ChunkRef scene = of_row[x], target = target_of_row[x];
        if (!asked[x] || store::is_left_out(scene) || store::is_left_out(target)) continue;
        const auto depths = of_target.cache.block(target);
        views::ViewTiles tile{x, y, nullptr, samples_of(*depths)};
        auto shown = of_scene.cache.kept_block(scene);
        if (shown == nullptr) {
          // Most of what faces an eye is hidden from it by the target: a fifth of the bytes tells.
          if (!views.kernels->sees(look.limits, tile, places)) continue;
          shown = of_scene.cache.block(scene);
        }
        tile.scene = samples_of(*shown);
        views.kernels->gather(look.limits, tile, places, sights);
      }
    }
  }
}

/// What no view has seen, or none unhidden, is looked for inside of the target.
void look_inside(const Look& look, std::span<const surface::TexelPacket> packets,
                 std::span<views::SightPacket> sights) {
  std::vector<surface::TexelPacket> left;
  for (std::size_t first = 0; first < packets.size(); first += SceneViews::kInsideAtOnce) {
    const auto own =
        sights.subspan(first, std::min(SceneViews::kInsideAtOnce, packets.size() - first));
    left.assign(&packets[first], &packets[first] + own.size());
    if (views::drop_clear(left, own))
      look_around(look, {*look.views.inside_scene, {}}, {*look.views.inside_target, {}}, left, own);
  }
}

}  // namespace

void take_turn(AroundWork& work, bool several, projection::SplatState& rays) {
  const auto block_of = [&](std::size_t group) {
    return work.packets[work.groups[group].first].block;
  };
  const auto begin_of = [&](std::size_t group) -> std::size_t {
    return group < work.groups.size() ? work.groups[group].first : work.packets.size();
  };
  const auto next_block = [&](std::size_t group) {
    const std::uint32_t block = block_of(group);
    while (group < work.groups.size() && block_of(group) == block) ++group;
    return group;
  };
  const auto unseen = [&](std::size_t group, std::size_t end) {
    const std::size_t first = begin_of(group), count = begin_of(end) - first;
    return views::count_unseen(std::span(work.packets).subspan(first, count),
                               std::span(work.sights).subspan(first, count));
  };
  if (work.end == 0) {
    work.ray.resize(work.packets.size());
    // Once for all turns, by what the piece's lease holds; each array may take a page more than
    // its share of all.
    constexpr std::size_t kInPages = 16;
    const std::size_t share = work.packets.size() / kTurns;
    std::size_t most = several ? share - std::min(share, kInPages) : work.packets.size();
    for (std::size_t g = 0; g < work.groups.size();) {
      const std::size_t next = next_block(g);
      most = std::max(most, begin_of(next) - begin_of(g));
      g = next;
    }
    rays.packets.reserve(std::min(most, unseen(0, work.groups.size())));
  }
  work.first = work.end;
  std::size_t end = work.next_group, count = 0;
  while (end < work.groups.size()) {
    const std::size_t next = next_block(end);
    count += unseen(end, next);
    if (count > rays.packets.capacity()) break;
    end = next;
  }
  rays.packets.clear();
  rays.groups.clear();
  views::leave_unseen(std::span(work.groups).subspan(work.next_group, end - work.next_group),
                      work.packets, work.sights, work.ray, rays);
  work.next_group = end;
  work.end = begin_of(end);
}

void look_around(job::JobContext& job, const SceneViews& views, const views::SightLimits& limits,
                 std::size_t at_once, bool backwards, AroundWork& work) {
  const Look look{views, limits, backwards};
  work.sights.reserve(work.packets.capacity());  // as other pieces had it
  work.sights.clear();
  for (std::size_t first = 0; first < work.packets.size(); first += at_once) {
    job.meter.throw_if_cancelled();
    const std::size_t count = std::min(at_once, work.packets.size() - first);
    work.sights.resize(first + count);  // cleared as they are needed: in the processor's cache
    const auto packets = std::span(work.packets).subspan(first, count);
    const auto sights = std::span(work.sights).subspan(first, count);
    look_around(look, {*views.scene, views.scene_tiles}, {*views.target, views.target_tiles},
                packets, sights);
    if (views.inside_scene) look_inside(look, packets, sights);
  }
}

}  // namespace pounce::flow
