// SPDX-License-Identifier: Apache-2.0
//
// Which parts of its images a source shows. A scan's surface may show a tenth of its texture, and
// tiles of an image that no triangle touches need not be kept. What the triangles' UVs touch is
// known before an image is decoded; lookups reach a little farther.
//
// From how far they are seen. A model of a thousand materials on one image, or the textures of a
// film on a model for a game, have a hundred texels and more under each of the target's: levels of
// the images are looked at then (projection/footprint.cpp), and the images themselves need not be
// kept. How many texels lie under one is known on average, from areas; UVs are stretched, so levels
// are kept that are finer than that.
#include "planning/seen_images.h"

#include <algorithm>
#include <cmath>

#include "projection/footprint.h"
#include "shading/mip_levels.h"
#include "surface/strewn_places.h"

namespace pounce::planning {
namespace {

/// The apron, how far outside of its triangle a hit may be, and how far lookups in the image itself
/// (not in a level) spread: half of 32 texels (projection/footprint.cpp). Beyond, the whole image
/// is built: this only saves work.
constexpr double kSeenAround = 24;
/// Of the source's texels per target texel: from here on many are seen in levels.
constexpr double kFromAfar = 4;
/// How much finer lookups may be than on average: UVs are stretched.
constexpr double kFiner = 4;

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

/// Texels of one page's image per unit of area; 0: nobody can say.
double density(const surface::GeometryRequest& request, std::size_t page) {
  const auto triangles = request.triangles->of(request.first_page + page);
  const double area = surface::surface_area(*request.mesh, triangles);
  return area > 0 ? mesh::texel_area(*request.mesh, request.pages[page], triangles) / area : 0;
}

/// The least level that lookups of `texels` of an image across take, and some that are finer.
std::uint32_t level_below(double texels) {
  const double size = texels / projection::kNarrow / kFiner;
  return size >= 2 ? static_cast<std::uint32_t>(std::min(std::log2(size), 31.0)) : 0;
}

/// That of an image, as far as its sides can be halved.
std::uint32_t stored_level(const io::ImageInfo& info, std::uint32_t level) {
  store::ColourDirectory image;
  image.width = info.width;
  image.height = info.height;
  image.depth = info.depth;
  level = std::min({level, kMostSeenLevel, shading::last_level(image)});
  while (level > 0 && !shading::is_halved_evenly(image, level)) --level;
  return level;
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

void TargetDetail::add(const SourcePlan& source, const TargetPlan& target) {
  finest.resize(source.passes.size());
  for (std::size_t p = 0; p < source.passes.size(); ++p) {
    const ImageSize size = source.passes[p].size;
    least_texels =
        std::min(least_texels, std::uint64_t{size.width} * size.height * target.pages.size());
    for (const surface::GeometryRequest& request : target.requests[p]) {
      for (std::size_t page = 0; page < request.pages.size(); ++page)
        finest[p] = std::max(finest[p], density(request, page));
    }
  }
}

bool is_seen_from_afar(const SourcePlan& plan, const TargetDetail& targets) {
  return std::any_of(plan.passes.begin(), plan.passes.end(), [&](const PassPlan& pass) {
    return texels_shown(pass) > kFromAfar * static_cast<double>(targets.least_texels);
  });
}

std::vector<std::uint32_t> seen_levels(const SourcePlan& plan, const TargetDetail& targets) {
  std::vector<std::uint32_t> levels(plan.columns.size(), kMostSeenLevel);
  std::vector<bool> is_used(plan.columns.size());
  for (std::size_t p = 0; p < plan.passes.size(); ++p) {
    const PassPlan& pass = plan.passes[p];
    for (std::size_t page = 0; page < pass.source.pages.size(); ++page) {
      const mesh::Lattice& lattice = pass.source.pages[page];
      if (lattice.width == 0) continue;
      const double finest = targets.finest[p];
      const double texels = finest > 0 ? density(pass.source, page) / finest : 0;
      const auto meet = [&](std::size_t c) {
        const io::ImageInfo& info = plan.columns[c].info;
        const double width = static_cast<double>(info.width) / lattice.width,
                     height = static_cast<double>(info.height) / lattice.height;
        const double across = std::sqrt(texels * width * height);
        levels[c] = std::min(levels[c], stored_level(info, level_below(across)));
        is_used[c] = true;
      };
      for (const std::size_t c : pass.channels) {
        const PageTexture& texture = plan.channels[c].pages[page];
        if (texture.column >= 0) meet(static_cast<std::size_t>(texture.column));
        if (texture.tile_set < 0) continue;
        for (const auto& [tile, column] :
             plan.tile_sets[static_cast<std::size_t>(texture.tile_set)].columns)
          meet(column);
      }
    }
  }
  for (std::size_t c = 0; c < levels.size(); ++c) {
    if (!is_used[c]) levels[c] = 0;
  }
  return levels;
}

}  // namespace pounce::planning
