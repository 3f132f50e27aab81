// SPDX-License-Identifier: Apache-2.0
//
// A block's texels one channel after the other, in each packet after packet: sixteen lookups go
// side by side where images and kernel allow it (PacketBlend), to the bits that one by one gives.
// What is left is blended alone: float images, constants, UDIM tiles without image.
//
// Images differ from channel to channel, hits do not: the packets of a block are visited once for
// each channel. A channel of a block begins with an empty window of decoded tiles, in which most
// lookups of the block find their tile.
#include "flow/project/hit_shading.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "flow/project/pieces.h"
#include "projection/hit_block.h"

namespace pounce::flow {
namespace {

bool is_tinted(const ChannelOutput& channel) {
  return std::any_of(channel.pages.begin(), channel.pages.end(),
                     [](const PageColour& page) { return page.tinted; });
}

/// Shades the blocks of a piece.
class BlockShading {
 public:
  BlockShading(job::JobContext& job, const store::GeometryStore& target,
               const std::vector<ChannelOutput>& channels, const Lookup& lookup)
      : job_(job), target_(target), channels_(channels), lookup_(lookup) {}

  void shade_block(HitWork& work, std::size_t c, std::size_t b, std::uint32_t first,
                   std::uint32_t last) const {
    const ChannelOutput& channel = channels_[c];
    const std::size_t texel_bytes = channel.format.texel_bytes();
    shading::ResultBlock result;
    result.texels.resize(store::kTexelsPerBlock * texel_bytes);
    BlockBlend blend{{}, {*lookup_.lanes, lookup_.blend, *lookup_.levels}};
    std::uint64_t covered = 0;
    std::optional<BlockFrames> own;
    // Frames are read again from the target's store, here and not at the beginning of the piece: so
    // no piece holds them while it searches.
    if (channel.shape && is_normal(*channel.shape)) own.emplace(job_, target_, work.blocks[b]);
    for (std::uint32_t p = first; p < last; ++p) {
      const projection::HitPacket& hit = work.state.hits[p];
      const surface::TexelPacket& texels = work.state.packets[p];
      if (channel.is_map) {
        covered += store_map(channel, work, p, result);
        continue;
      }
      if (!channel.shape || is_normal(*channel.shape)) {
        blend.packet.look_up(channel.pages, hit, texels, work.axes[texels.block],
                             read_format(channel), !channel.shape, blend.window);
      }
      for (int lane = 0; lane < surface::kLanes; ++lane) {
        if (!is_hit(hit, texels, lane)) continue;
        const std::uint16_t texel = texels.texel[lane];
        std::byte* const out = result.texels.data() + texel * texel_bytes;
        const bool has_value =
            channel.shape ? store_shape(channel, work, p, lane, own ? &own->frames : nullptr, blend,
                                        out, work.clipped[c])
                          : store_colour(channel, work, p, lane, blend, out, work.clipped[c]);
        if (!has_value) continue;
        result.cover(texel);
        ++covered;
      }
    }
    work.covered[c] += covered;
    // A block without a covered texel is not stored at all: writing images takes a missing block as
    // empty.
    if (covered == 0) return;
    finish_block(job_, channel.format, result, c, b, work);
  }

 private:
  /// Where the texels of a packet hit. Returns how many did.
  static std::uint64_t store_map(const ChannelOutput& channel, const HitWork& work, std::size_t p,
                                 shading::ResultBlock& result) {
    const projection::HitPacket& hit = work.state.hits[p];
    const surface::TexelPacket& texels = work.state.packets[p];
    const std::vector<surface::TexelAxes>& axes = work.axes[texels.block];
    std::uint64_t count = 0;
    for (int l = 0; l < surface::kLanes; ++l) {
      if (!is_hit(hit, texels, l)) continue;
      const auto lane = static_cast<std::size_t>(l);
      const PageColour& page = channel.pages[static_cast<std::size_t>(hit.page[lane])];
      const projection::HitMapTexel values =
          projection::map_texel(hit, texels, work.points[p], lane, page.lattice,
                                axes.empty() ? nullptr : &axes[texels.owner[lane]]);
      std::memcpy(result.texels.data() + texels.texel[lane] * sizeof values, values.data(),
                  sizeof values);
      result.cover(texels.texel[lane]);
      ++count;
    }
    return count;
  }

  /// What the channel's images are read for. A vector of a normal map is no colour: it is read as
  /// the map states it, never times alpha.
  static shading::TexelFormat read_format(const ChannelOutput& channel) {
    shading::TexelFormat format = channel.format;
    format.premultiplied = format.premultiplied && !channel.shape;
    return format;
  }

  /// What blending a block goes on with from packet to packet.
  struct BlockBlend {
    ColourWindow window;
    PacketBlend packet;
  };

  static projection::Footprint footprint(const HitWork& work, std::size_t packet, int lane) {
    const surface::TexelPacket& texels = work.state.packets[packet];
    return footprint_at(work.state.hits[packet], texels, work.axes[texels.block], lane);
  }

  /// Writes the colour of one hit in the output's format and adds the samples that it cannot hold
  /// to `clipped`. False: it met a UDIM tile without image.
  bool store_colour(const ChannelOutput& channel, const HitWork& work, std::size_t packet, int lane,
                    BlockBlend& blend, std::byte* out, std::uint64_t& clipped) const {
    // From the most special case to the most general one. Where several apply, all give the same
    // bits: it must not show which lanes happened to share a packet.
    if (blend.packet.has_texel(lane)) {
      std::memcpy(out, blend.packet.texel(lane), channel.format.texel_bytes());
      return true;
    }
    const projection::HitPacket& hit = work.state.hits[packet];
    const PageColour& page = channel.pages[static_cast<std::size_t>(hit.page[lane])];
    std::optional<shading::Factor> vertices;
    if (page.tinted) vertices = vertex_factor(work.points[packet].colour(lane));
    const shading::Factor* const tint = vertices ? &*vertices : nullptr;
    if (page.column == nullptr && page.tile_set == nullptr) {
      clipped +=
          shading::store_texel(channel.format, constant_value(page, tint, channel.format), out);
      return true;
    }
    if (blend.packet.has_samples(lane)) {
      clipped += shading::store_texel(
          channel.format, lanes_value(page, blend.packet, lane, channel.format, tint), out);
      return true;
    }
    const PageImage image = image_at(page, place_of(hit, lane));
    if (image.column == nullptr) return false;
    const auto lookups = image.lookups(footprint(work, packet, lane));
    // Nothing changes the samples on their way into the output, so the integer sum itself is
    // rounded. With any conversion, factor or mean the value must stay unrounded until the output's
    // format stores it.
    if (lookups.single() && image.input == nullptr && !page.factor && !vertices &&
        channel.format.keeps(image.directory())) {
      const ColourPlace at = blend.window.find(image);
      projection::Taps taps;
      lookup_.blend(at.rest_x, at.rest_y, taps);
      projection::sharpen(lookups.sharpening, at.rest_x, at.rest_y, taps);
      projection::blend_u8(*at.image, at.tile, at.column, at.row, taps, out);
    } else {
      clipped += shading::store_texel(
          channel.format, value(page, image, lookups, channel.format, blend.window, tint), out);
    }
    return true;
  }

  /// What was looked up with the lanes beside it.
  static shading::TexelValue lanes_value(const PageColour& page, const PacketBlend& packet,
                                         int lane, const shading::TexelFormat& format,
                                         const shading::Factor* tint = nullptr) {
    const PageImage& image = packet.image(lane);
    return value_of(page, image.directory(), image.input, packet.samples(lane),
                    stays_premultiplied(image.directory(), image.input, format), format, tint);
  }

  shading::TexelValue value(const PageColour& page, const PageImage& image,
                            const projection::FootprintLookups& lookups,
                            const shading::TexelFormat& format, ColourWindow& window,
                            const shading::Factor* tint = nullptr) const {
    if (!lookups.single())
      return window.average(page, image, lookups, lookup_.blend, format, *lookup_.levels, tint);
    const ColourPlace at = window.find(image);
    projection::Taps taps;
    lookup_.blend(at.rest_x, at.rest_y, taps);
    projection::sharpen(lookups.sharpening, at.rest_x, at.rest_y, taps);
    return blended(page, at, taps, format, tint);
  }

  /// What the pages of a channel give at a hit. Nothing: it met a UDIM tile without image.
  std::optional<shading::TexelValue> page_value(const ChannelOutput& channel, const HitWork& work,
                                                std::size_t packet, int lane,
                                                BlockBlend& blend) const {
    const projection::HitPacket& hit = work.state.hits[packet];
    const PageColour& page = channel.pages[static_cast<std::size_t>(hit.page[lane])];
    if (page.column == nullptr && page.tile_set == nullptr) return page.constant;
    const shading::TexelFormat straight = read_format(channel);
    if (blend.packet.has_samples(lane)) return lanes_value(page, blend.packet, lane, straight);
    const PageImage image = image_at(page, place_of(hit, lane));
    if (image.column == nullptr) return std::nullopt;
    return value(page, image, image.lookups(footprint(work, packet, lane)), straight, blend.window);
  }

  /// The same as store_colour() for a channel of the surface itself. `frames` are of
  /// the texel's block, where it is a normal map.
  bool store_shape(const ChannelOutput& channel, const HitWork& work, std::uint32_t p, int lane,
                   const surface::TexelFrames* frames, BlockBlend& blend, std::byte* out,
                   std::uint64_t& clipped) const {
    const shading::ShapeOutput& shape = *channel.shape;
    const projection::SurfacePacket& surface = work.points[p];
    if (!is_normal(shape)) {
      const shading::HitPoint at{surface.height[lane], surface.position(lane),
                                 surface.colour(lane)};
      clipped += shading::store_texel(channel.format, shading::baked_value(shape, at), out);
      return true;
    }
    const projection::HitPacket& hit = work.state.hits[p];
    const auto map = page_value(channel, work, p, lane, blend);
    if (!map) return false;
    const TangentFrame target = frames->frame(work.state.packets[p].texel[lane]);
    clipped += shading::store_texel(
        channel.format,
        shading::transferred_normal(shape, hit.page[lane], *map, surface.frame(lane), target), out);
    return true;
  }

  /// The frames of a block's texels, read again: only a normal map needs them.
  struct BlockFrames {
    store::GeometryBlock block;
    surface::TexelFrames frames;
    BlockFrames(job::JobContext& job, const store::GeometryStore& target,
                const store::BlockEntry& entry)
        : block(target.read_block(entry, job.compressor())),
          frames(block, target.directory().pages[entry.page]) {}
  };

  job::JobContext& job_;
  const store::GeometryStore& target_;
  const std::vector<ChannelOutput>& channels_;
  const Lookup& lookup_;
};

}  // namespace

bool needs_surface(const ChannelOutput& channel) { return channel.shape || is_tinted(channel); }
bool needs_points(const ChannelOutput& channel) { return channel.is_map || needs_surface(channel); }

std::uint64_t shading_bytes(std::uint64_t colour_tile_bytes) {
  return colour_tile_bytes * (ColourWindow::kTiles + 2) +
         ColourLevels::making_bytes(colour_tile_bytes);
}

HitShading::HitShading(job::JobContext& job, const store::GeometryStore& target,
                       std::vector<ChannelOutput> channels, const Lookup& lookup)
    : job_(&job), target_(&target), channels_(std::move(channels)), lookup_(lookup) {}

std::uint64_t HitShading::result_texel_bytes() const {
  std::uint64_t bytes = 0;
  for (const ChannelOutput& channel : channels_) bytes += channel.format.texel_bytes();
  return bytes;
}

std::uint64_t HitShading::lookup_bytes() const {
  std::uint64_t largest = 0;
  for (const ChannelOutput& channel : channels_) {
    for (const PageColour& page : channel.pages) largest = std::max(largest, tile_bytes(page));
  }
  return shading_bytes(largest);
}

void HitShading::shade(HitWork& work) const {
  const BlockShading blocks(*job_, *target_, channels_, lookup_);
  work.stored.resize(channels_.size());
  work.raw_bytes.resize(channels_.size());
  work.covered.resize(channels_.size());
  work.clipped.resize(channels_.size());
  // Packets are in the order of their blocks, so counts per block, added up, are the blocks'
  // ranges.
  std::vector<std::uint32_t> first_packet(work.blocks.size() + 1, 0);
  for (const auto& packet : work.state.packets) ++first_packet[packet.block + 1];
  for (std::size_t b = 0; b < work.blocks.size(); ++b) first_packet[b + 1] += first_packet[b];
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    work.stored[c].resize(work.blocks.size());
    for (std::size_t b = 0; b < work.blocks.size(); ++b) {
      blocks.shade_block(work, c, b, first_packet[b], first_packet[b + 1]);
    }
  }
}

// --- sixteen lookups side by side ----------------------------------------------------------------
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
// image: constants, UDIM tiles without image; and those of tents and of colours that are divided by
// their alpha, where images are deeper than 8 bits.

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
  const Mask found = find_images(pages, hit, texels, axes, format);
  if (found == 0) return;
  lanes_.lookups(footprints_, last_level_, lookups_);
  for (auto& channel : means_) channel.fill(0);
  Mask kept = 0, alone = 0;
  // Where the output stores samples as the image holds them, one lookup is rounded from its integer
  // sum at once. A mean of several is a sum of doubles: it is rounded at the end, when all sets
  // were added.
  for (Mask left = found; left != 0;) {
    const std::size_t first = first_of(left);
    const Mask group = like(first, left);
    left &= ~group;
    const bool keeps_samples = rounds && keeps(first, format);
    if (keeps_samples) kept |= group;
    if (const Mask single = group & lookups_.single; single != 0) {
      add_single(first, single, keeps_samples, window);
      alone |= single & signed_zeros(first, single);
    }
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
  blended_ = found & ~(kept & lookups_.single) & ~alone;
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

bool PacketBlend::may_join(const PageImage& image, const shading::TexelFormat& format) const {
  const store::ColourDirectory& directory = image.directory();
  if (directory.depth == Depth::u8) return true;
  return keys_ != projection::kTent &&
         (!directory.premultiplied || stays_premultiplied(directory, image.input, format));
}

/// The lanes whose images may be looked up together with others.
PacketBlend::Mask PacketBlend::find_images(std::span<const PageColour> pages,
                                           const projection::HitPacket& hit,
                                           const surface::TexelPacket& texels,
                                           const std::vector<surface::TexelAxes>& axes,
                                           const shading::TexelFormat& format) {
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
    if (image.column == nullptr || !may_join(image, format)) continue;
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

/// The lanes, of one float image, that have a 0 whose sign may not be that of one lookup alone.
PacketBlend::Mask PacketBlend::signed_zeros(std::size_t first, Mask lanes) const {
  const store::ColourDirectory& image = images_[first].directory();
  if (!store::is_float(image.depth)) return 0;
  Mask out = 0;
  for_each_lane(lanes, [&](std::size_t lane) {
    for (std::size_t c = 0; c < image.channels; ++c)
      out |= (means_[c][lane] == 0 ? 1U : 0U) << lane;
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
                                image.channels, image.depth,  image.wrap_u,  image.wrap_v};
  projection::add_lookups(
      lanes_, keys_, set, number == 0 ? sharpening(lanes) : nullptr, in, middles_, lanes,
      [&](std::uint32_t x, std::uint32_t y) { return window.tile(level, x, y); }, places_, means_);
}

/// The same of lanes that have one lookup in the image itself.
void PacketBlend::add_single(std::size_t first, Mask lanes, bool rounds, ColourWindow& window) {
  const ColourCache& column = *images_[first].column;
  const store::ColourDirectory& image = column.store().directory();
  const std::size_t channels = image.channels;
  places_.offset.fill(0);
  places_.share.fill(0);
  places_.active = lanes;
  for_each_lane(lanes, [&](std::size_t lane) {
    places_.set_place(lane, images_[lane].x, images_[lane].y, image.texel_bytes());
    places_.share[lane] = 1;
  });
  if (store::is_float(image.depth)) places_.settle();
  const auto* const sharpened = sharpening(lanes);
  projection::for_each_tile(
      places_, [&](std::uint32_t x, std::uint32_t y) { return window.tile(column, x, y); },
      [&](const std::byte* tile, const Sixteen<double>& share, Mask same) {
        if (!rounds) {
          return lanes_.add[static_cast<std::size_t>(image.depth)][channels - 1](
              tile, places_, share, keys_, sharpened, means_);
        }
        alignas(64) Sixteen<std::uint32_t> rounded;
        lanes_.round_u8[channels - 1](tile, places_, keys_, sharpened, rounded);
        for_each_lane(same, [&](std::size_t lane) { texels_[lane] = rounded[lane]; });
      });
}

}  // namespace pounce::flow
