// SPDX-License-Identifier: Apache-2.0
#include "flow/project/around.h"

#include <algorithm>
#include <vector>

namespace pounce::flow {
namespace {

void look_around(const SceneViews& views, const ColourCache& of_scene, const ColourCache& of_target,
                 std::span<const surface::TexelPacket> packets,
                 std::span<views::SightPacket> sights) {
  std::vector<views::PlacePacket> places;
  const std::uint32_t across = views.grid.tiles_across();
  std::vector<char> tiles(std::size_t{across} * across);  // of a view: some texel may lie there
  for (std::uint32_t view = 0; view < views.grid.views(); ++view) {
    views::place(views.grid, view, *views.kernels, packets, places, sights);
    std::fill(tiles.begin(), tiles.end(), false);
    views::TileRange last;  // most packets lie where the one before does
    for (const views::PlacePacket& place : places) {
      if (place.tiles == last) continue;
      last = place.tiles;
      for (std::uint32_t y = last.y0; y <= last.y1; ++y) {
        for (std::uint32_t x = last.x0; x <= last.x1; ++x)
          tiles[y * std::size_t{across} + x] = true;
      }
    }
    for (std::uint32_t y = 0; y < across; ++y) {
      const auto asked = std::span(tiles).subspan(y * std::size_t{across}, across);
      if (std::find(asked.begin(), asked.end(), true) == asked.end()) continue;
      const std::uint32_t row = views.grid.tile_row(view, y);
      const auto of_row = of_scene.index(row), target_of_row = of_target.index(row);
      for (std::uint32_t x = 0; x < across; ++x) {
        // Where there is nothing of the one or the other, no texel is seen.
        const store::ChunkRef scene = (*of_row)[x], target = (*target_of_row)[x];
        if (!asked[x] || store::is_left_out(scene) || store::is_left_out(target)) continue;
        const auto shown = of_scene.block(scene), depths = of_target.block(target);
        views.kernels->gather(views.limits, {x, y, samples_of(*shown), samples_of(*depths)}, places,
                              sights);
      }
    }
  }
}

/// What no view has seen, or none unhidden, is looked for inside of the target.
void look_inside(const SceneViews& views, std::span<const surface::TexelPacket> packets,
                 std::span<views::SightPacket> sights) {
  std::vector<surface::TexelPacket> left;
  for (std::size_t first = 0; first < packets.size(); first += SceneViews::kInsideAtOnce) {
    const auto own =
        sights.subspan(first, std::min(SceneViews::kInsideAtOnce, packets.size() - first));
    left.assign(&packets[first], &packets[first] + own.size());
    if (views::drop_clear(left, own))
      look_around(views, *views.inside_scene, *views.inside_target, left, own);
  }
}

}  // namespace

void look_around(job::JobContext& job, const SceneViews& views, AroundWork& work) {
  work.sights.reserve(work.packets.capacity());  // as other pieces had it
  work.sights.assign(work.packets.size(), views::SightPacket{});
  // Block by block, whose sums stay in the processor's cache while all views go past.
  for (std::size_t p = 0; p < work.packets.size();) {
    const std::size_t first = p;
    while (p < work.packets.size() && work.packets[p].block == work.packets[first].block) ++p;
    job.meter.throw_if_cancelled();
    const auto packets = std::span(work.packets).subspan(first, p - first);
    const auto sights = std::span(work.sights).subspan(first, p - first);
    look_around(views, *views.scene, *views.target, packets, sights);
    if (views.inside_scene) look_inside(views, packets, sights);
  }
}

}  // namespace pounce::flow
