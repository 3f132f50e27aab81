// SPDX-License-Identifier: Apache-2.0
//
// Sixteen lookups side by side (docs/decisions/040-blend-lanes.md).
//
// The lanes of a packet are close together on the target, so mostly they need the same image, the
// same level and the same tile. Nothing guarantees that. So lanes are grouped: by page and image
// here, then by level, then by tile in projection/blend_lanes.h. Each group is blended under a
// mask of its lanes, so a packet on a chart's border is as right as any.
//
// A lane gets one of three results: a finished texel (`rounded_`), samples that shading has yet to
// convert (`blended_`), or neither, and then it is blended alone. The last are lanes without an
// image of 8 bits: floats, constants, UDIM tiles without image. A filter without a kernel for lanes
// leaves all of them alone.
#include "flow/project/packet_blend.h"

#include <bit>

namespace pounce::flow {
namespace {

using projection::FootprintLookupsLanes;
using projection::for_each_lane;
using projection::Sixteen;

std::size_t first_of(unsigned lanes) { return static_cast<std::size_t>(std::countr_zero(lanes)); }

}  // namespace

projection::Footprint footprint_at(const projection::HitPacket& hit,
                                   const surface::TexelPacket& texels,
                                   const std::vector<surface::TexelAxes>& axes, int lane) {
  const projection::TexelGradients gradients{
      {hit.x_by[0][lane], hit.x_by[1][lane], hit.x_by[2][lane]},
      {hit.y_by[0][lane], hit.y_by[1][lane], hit.y_by[2][lane]}};
  if (axes.empty()) return projection::footprint_of(gradients, 1 / texels.per_texel[lane]);
  const surface::TexelAxes& own = axes[texels.owner[lane]];
  return projection::footprint_of(gradients, own.x, own.y);
}

void PacketBlend::look_up(std::span<const PageColour> pages, const projection::HitPacket& hit,
                          const surface::TexelPacket& texels,
                          const std::vector<surface::TexelAxes>& axes,
                          const shading::TexelFormat& format, bool rounds, ColourWindow& window) {
  rounded_ = blended_ = 0;
  if (keys_ == 0) return;
  const Mask found = find_images(pages, hit, texels, axes);
  if (found == 0) return;
  lanes_.lookups(footprints_, last_level_, lookups_);
  for (auto& channel : means_) channel.fill(0);
  Mask kept = 0;
  // Where the output stores samples as the image holds them, one lookup is rounded from its integer
  // sum at once. A mean of several is a sum of doubles: it is rounded at the end, when all sets
  // were added.
  for (Mask left = found; left != 0;) {
    const std::size_t first = first_of(left);
    const Mask group = like(first, left);
    left &= ~group;
    const bool keeps_samples = rounds && keeps(first, format);
    if (keeps_samples) kept |= group;
    if (const Mask single = group & lookups_.single; single != 0)
      add_single(first, single, keeps_samples, window);
    for (std::size_t s = 0; s < 2; ++s) {
      // The second set is that of the next level, mixed in near the end of a level's range
      // (docs/decisions/033-footprints.md).
      Mask several = group & ~lookups_.single & (s == 0 ? ~0U : lookups_.two);
      while (several != 0) {
        const std::size_t lane = first_of(several);
        Mask level = 0;
        for_each_lane(several, [&](std::size_t i) {
          if (lookups_.sets[s].level[i] == lookups_.sets[s].level[lane]) level |= 1U << i;
        });
        add_set(s, lane, level, window);
        several &= ~level;
      }
    }
  }
  blended_ = found & ~(kept & lookups_.single);
  const Mask means = kept & ~lookups_.single;
  rounded_ = kept;
  if (means == 0) return;
  Sixteen<std::uint32_t> rounded;
  lanes_.round_means(means_, format.channels, rounded);
  for_each_lane(means, [&](std::size_t lane) { texels_[lane] = rounded[lane]; });
}

projection::Blended PacketBlend::samples(int lane) const {
  const auto i = static_cast<std::size_t>(lane);
  return {means_[0][i], means_[1][i], means_[2][i], means_[3][i]};
}

/// The lanes whose images may be looked up together with others.
PacketBlend::Mask PacketBlend::find_images(std::span<const PageColour> pages,
                                           const projection::HitPacket& hit,
                                           const surface::TexelPacket& texels,
                                           const std::vector<surface::TexelAxes>& axes) {
  Mask found = 0;
  const ColourCache* before = nullptr;
  std::int32_t last_level = 0;
  for (int l = 0; l < surface::kLanes; ++l) {
    if (!is_hit(hit, texels, l)) continue;
    const auto lane = static_cast<std::size_t>(l);
    const PageColour& page = pages[static_cast<std::size_t>(hit.page[l])];
    if (page.column == nullptr && page.tile_set == nullptr) continue;
    PageImage& image = images_[lane];
    image = image_at(page, place_of(hit, l));
    if (image.column == nullptr || image.directory().depth != Depth::u8) continue;
    const projection::Footprint footprint = image.on_image(footprint_at(hit, texels, axes, l));
    // Neighbouring lanes mostly share an image: its number of levels is asked for once.
    if (image.column != before) {
      before = image.column;
      last_level = static_cast<std::int32_t>(shading::last_level(image.directory()));
    }
    pages_[lane] = &page;
    footprints_.ax[lane] = footprint.a.x;
    footprints_.ay[lane] = footprint.a.y;
    footprints_.bx[lane] = footprint.b.x;
    footprints_.by[lane] = footprint.b.y;
    middles_.x[lane] = image.middle.x;
    middles_.y[lane] = image.middle.y;
    last_level_[lane] = last_level;
    found |= 1U << lane;
  }
  return found;
}

/// The lanes that are of the same page and image.
PacketBlend::Mask PacketBlend::like(std::size_t lane, Mask among) const {
  Mask out = 0;
  for_each_lane(among, [&](std::size_t i) {
    if (pages_[i] == pages_[lane] && images_[i].column == images_[lane].column) out |= 1U << i;
  });
  return out;
}

/// Is what the image holds what the output stores?
bool PacketBlend::keeps(std::size_t lane, const shading::TexelFormat& format) const {
  return images_[lane].input == nullptr && !pages_[lane]->factor && !pages_[lane]->tinted &&
         format.keeps(images_[lane].directory());
}

const FootprintLookupsLanes* PacketBlend::sharpening(Mask lanes) const {
  // Null where no lane asks for it: kernels skip the work for the whole packet.
  std::int32_t any = 0;
  for_each_lane(lanes,
                [&](std::size_t lane) { any |= lookups_.across[lane] | lookups_.down[lane]; });
  return any != 0 ? &lookups_ : nullptr;
}

/// Adds a set of lookups of lanes that have one level of one image.
void PacketBlend::add_set(std::size_t s, std::size_t first, Mask lanes, ColourWindow& window) {
  const projection::LookupsLanes& set = lookups_.sets[s];
  const ColourCache& column = *images_[first].column;
  const auto number = static_cast<std::uint32_t>(set.level[first]);
  const ColourCache& level = number == 0 ? column : levels_.get(column, number);
  const store::ColourDirectory& image = column.store().directory();
  const store::ColourDirectory& smaller = level.store().directory();
  const projection::LookedUp in{image.width,    image.height, smaller.width, smaller.height,
                                image.channels, image.wrap_u, image.wrap_v};
  projection::add_lookups(
      lanes_, keys_, set, number == 0 ? sharpening(lanes) : nullptr, in, middles_, lanes,
      [&](std::uint32_t x, std::uint32_t y) { return window.tile(level, x, y); }, places_, means_);
}

/// The same of lanes that have one lookup in the image itself.
void PacketBlend::add_single(std::size_t first, Mask lanes, bool rounds, ColourWindow& window) {
  const ColourCache& column = *images_[first].column;
  const std::size_t channels = column.store().directory().channels;
  places_.offset.fill(0);
  places_.share.fill(0);
  places_.active = lanes;
  for_each_lane(lanes, [&](std::size_t lane) {
    places_.set_place(lane, images_[lane].x, images_[lane].y, channels);
    places_.share[lane] = 1;
  });
  const auto* const sharpened = sharpening(lanes);
  projection::for_each_tile(
      places_, [&](std::uint32_t x, std::uint32_t y) { return window.tile(column, x, y); },
      [&](const std::byte* tile, const Sixteen<double>& share, Mask same) {
        if (!rounds)
          return lanes_.add_u8[channels - 1](tile, places_, share, keys_, sharpened, means_);
        alignas(64) Sixteen<std::uint32_t> rounded;
        lanes_.round_u8[channels - 1](tile, places_, keys_, sharpened, rounded);
        for_each_lane(same, [&](std::size_t lane) { texels_[lane] = rounded[lane]; });
      });
}

}  // namespace pounce::flow
