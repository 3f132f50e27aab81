// SPDX-License-Identifier: Apache-2.0
//
// Which parts of its images a source shows. A scan's surface may show a tenth of its texture, and
// tiles of an image that no triangle touches need not be kept. What the triangles' UVs touch is
// known before an image is decoded; lookups reach a little farther.
#include "planning/shown_tiles.h"

#include <algorithm>

namespace pounce::planning {

namespace {

/// The apron, how far outside of its triangle a hit may be, and how far lookups in the image itself
/// (not in a level) spread: half of 32 texels (projection/footprint.cpp). Beyond, the whole image
/// is built: this only saves work.
constexpr double kSeenAround = 24;
/// So few tiles of an image are not worth leaving out.
constexpr std::uint64_t kFewTiles = 16;
/// Of the source's texels per target texel: from here on many are seen in levels.
constexpr double kFromAfar = 4;

/// Texels of the images that a pass shows.
double texels_shown(const PassPlan& pass) {
  double texels = 0;
  for (std::size_t p = 0; p < pass.source.pages.size(); ++p) {
    if (pass.source.pages[p].width == 0) continue;  // no image, and perhaps no UVs
    texels += mesh::texel_area(*pass.source.mesh, pass.source.pages[p],
                               pass.source.triangles->of(pass.source.first_page + p));
  }
  return texels;
}

void add_shown(const SourcePlan& plan, const PassPlan& pass, const ChannelPlan& channel,
               std::vector<std::unique_ptr<mesh::TileMask>>& masks) {
  for (std::size_t p = 0; p < channel.pages.size(); ++p) {
    if (channel.pages[p].column < 0) continue;
    const auto c = static_cast<std::size_t>(channel.pages[p].column);
    if (masks[c] == nullptr) continue;
    // The search may be on another image's lattice, in proportion.
    mesh::Lattice of_image = pass.source.pages[p];
    of_image.width = plan.columns[c].info.width;
    of_image.height = plan.columns[c].info.height;
    mesh::add_touched(*pass.source.mesh, of_image,
                      pass.source.triangles->of(pass.source.first_page + p), plan.columns[c].wrap_u,
                      plan.columns[c].wrap_v, kSeenAround, *masks[c]);
  }
}

}  // namespace

WantedTiles little_shown(const SourcePlan& plan) {
  std::vector<std::unique_ptr<mesh::TileMask>> masks;
  for (const ColumnPlan& column : plan.columns) {
    masks.push_back(std::make_unique<mesh::TileMask>(column.info.width, column.info.height));
    if (masks.back()->tiles() <= kFewTiles) masks.back() = nullptr;
  }
  for (const TileSetPlan& set : plan.tile_sets) {
    for (const auto& [tile, column] : set.columns) masks[column] = nullptr;
  }
  for (const PassPlan& pass : plan.passes) {
    for (const std::size_t c : pass.channels) add_shown(plan, pass, plan.channels[c], masks);
  }
  WantedTiles shown(plan.columns.size());
  for (std::size_t c = 0; c < masks.size(); ++c) {
    // The forecast of disk space (planning/disk.cpp) counts on the half: some tiles, and later all
    // of them, take one and a half images at most.
    const bool is_little = masks[c] != nullptr && 2 * masks[c]->count() <= masks[c]->tiles();
    if (is_little) shown[c] = std::move(masks[c]);
  }
  return shown;
}

bool is_seen_from_afar(const SourcePlan& plan, std::uint64_t target_texels) {
  return std::any_of(plan.passes.begin(), plan.passes.end(), [&](const PassPlan& pass) {
    return texels_shown(pass) > kFromAfar * static_cast<double>(target_texels);
  });
}

}  // namespace pounce::planning
