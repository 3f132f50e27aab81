// SPDX-License-Identifier: Apache-2.0
//
// A block's texels packet after packet, in each channel after channel of those that are looked up
// together (PacketBlend): sixteen lookups go side by side where images and kernel allow it, to the
// bits that one by one gives. What is left is blended alone: constants, UDIM tiles without image,
// some images of more than 8 bits.
//
// Images differ from channel to channel, hits do not: the packets of a block are visited once for
// each group of channels.
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

bool is_looked_up(const ChannelOutput& channel) {
  return !channel.is_map && (!channel.shape || is_normal(*channel.shape));
}

/// What the channel's images are read for. A vector of a normal map is no colour: it is read as
/// the map states it, never times alpha.
shading::TexelFormat read_format(const ChannelOutput& channel) {
  shading::TexelFormat format = channel.format;
  format.premultiplied = format.premultiplied && !channel.shape;
  return format;
}

/// The largest decoded tile of a channel's images.
std::uint64_t most_tile_bytes(const ChannelOutput& channel) {
  std::uint64_t most = 0;
  for (const PageColour& page : channel.pages) most = std::max(most, tile_bytes(page));
  return most;
}

/// How many channels may keep tiles at hand: more than one only where the budget hardly feels it,
/// so that a job needs no more memory at least.
std::size_t most_together(const job::JobContext& job, const std::vector<ChannelOutput>& channels) {
  constexpr std::uint64_t kShare = 16;  // of a thread's
  const std::uint64_t room = job.budget.limit() / (kShare * std::max(job.threads, 1U));
  std::uint64_t largest = 0;
  for (const ChannelOutput& channel : channels)
    largest = std::max(largest, most_tile_bytes(channel));
  std::size_t most = LookupGroup::kMost;
  while (most > 1 && shading_bytes(largest, most) > room) --most;
  return most;
}

/// Each channel in one group, of `most` at most; those that look nothing up alone.
std::vector<LookupGroup> group_channels(const std::vector<ChannelOutput>& channels,
                                        const Lookup& lookup, std::size_t most) {
  std::vector<LookupGroup> out;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const ChannelOutput& channel = channels[c];
    const LookedUpChannel added{c, &channel.pages, read_format(channel), !channel.shape};
    if (!is_looked_up(channel)) {
      out.push_back({{added}, {}});
      continue;
    }
    const bool joined = std::any_of(out.begin(), out.end(), [&](LookupGroup& group) {
      return is_looked_up(channels[group.channels[0].channel]) && group.add(added, lookup, most);
    });
    if (!joined) out.emplace_back().add(added, lookup);
  }
  return out;
}

/// Shades the blocks of a piece.
class BlockShading {
 public:
  BlockShading(job::JobContext& job, const store::GeometryStore& target,
               const std::vector<ChannelOutput>& channels, const Lookup& lookup)
      : job_(job), target_(target), channels_(channels), lookup_(lookup) {}

  void shade_block(HitWork& work, const LookupGroup& group, std::size_t b, std::uint32_t first,
                   std::uint32_t last) const {
    std::vector<BlockResult> results(group.channels.size());
    std::optional<BlockFrames> frames;
    for (std::size_t g = 0; g < results.size(); ++g) {
      const ChannelOutput& channel = channels_[group.channels[g].channel];
      results[g].block.texels.resize(store::kTexelsPerBlock * channel.format.texel_bytes());
      // Frames are read again from the target's store, here and not at the beginning of the piece:
      // so no piece holds them while it searches.
      if (!frames && channel.shape && is_normal(*channel.shape))
        frames.emplace(job_, target_, work.blocks[b]);
    }
    PacketBlend blend(group, lookup_);
    const bool looks_up = is_looked_up(channels_[group.channels[0].channel]);
    for (std::uint32_t p = first; p < last; ++p) {
      const surface::TexelPacket& texels = work.state.packets[p];
      const unsigned hits = hits_of(work.state.hits[p], texels);
      if (looks_up) blend.look_up(work.state.hits[p], texels, hits, work.axes[texels.block]);
      for (std::size_t g = 0; g < results.size(); ++g) {
        const std::size_t c = group.channels[g].channel;
        const Packet packet{
            channels_[c], work, p, hits, g, blend, frames ? &frames->frames : nullptr};
        results[g].covered += channels_[c].is_map
                                  ? store_map(channels_[c], work, p, results[g].block)
                                  : store_packet(packet, results[g].block, work.clipped[c]);
      }
    }
    for (std::size_t g = 0; g < results.size(); ++g) {
      const std::size_t c = group.channels[g].channel;
      work.covered[c] += results[g].covered;
      // A block without a covered texel is not stored at all: writing images takes a missing block
      // as empty.
      if (results[g].covered != 0)
        finish_block(job_, channels_[c].format, results[g].block, c, b, job_.scratch_room(), work);
      results[g] = {};  // its memory
    }
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

  struct BlockResult {
    shading::ResultBlock block;
    std::uint64_t covered = 0;
  };

  /// A packet of one channel, with its lookups.
  struct Packet {
    const ChannelOutput& channel;
    const HitWork& work;
    std::uint32_t index;
    unsigned hits;       ///< lanes
    std::size_t member;  ///< of the channel in its group
    PacketBlend& blend;
    const surface::TexelFrames* frames;  ///< of the texels' block, where it is a normal map

    const projection::HitPacket& hit() const { return work.state.hits[index]; }
    const surface::TexelPacket& texels() const { return work.state.packets[index]; }
    const projection::SurfacePacket& surface() const { return work.points[index]; }
    const PageColour& page(int lane) const {
      return channel.pages[static_cast<std::size_t>(hit().page[lane])];
    }
    PageImage image(int lane) const { return image_at(page(lane), place_of(hit(), lane)); }
    projection::FootprintLookups lookups(const PageImage& image, int lane) const {
      return image.lookups(footprint_at(hit(), texels(), work.axes[texels().block], lane));
    }
    ColourWindow& window() const { return blend.window(member); }
  };

  static constexpr unsigned kRow = 4, kRows = surface::kLanes / kRow;

  /// Are a packet's texels rows of a block, four in each, as in the middle of a chart?
  static bool are_rows(const surface::TexelPacket& texels) {
    unsigned differs = 0;
    for (unsigned row = 0; row < kRows; ++row) {
      const std::uint16_t* const at = texels.texel + row * kRow;
      differs |= at[0] % kRow;
      for (unsigned i = 1; i < kRow; ++i) differs |= at[i] ^ (at[0] + i);
    }
    return differs == 0;
  }

  /// Those of `lanes` that were rounded to up to four channels of 8 bits.
  template <std::size_t texel_bytes>
  static void copy_texels(const Packet& packet, unsigned lanes, shading::ResultBlock& result) {
    std::byte* const to = result.texels.data();
    if (lanes == 0xFFFF && are_rows(packet.texels())) {
      for (unsigned row = 0; row < kRows; ++row) {
        const std::uint16_t first = packet.texels().texel[row * kRow];
        for (unsigned i = 0; i < kRow; ++i) {
          // Whole words as far as the row goes: the next texel overwrites what is too much.
          const int lane = static_cast<int>(row * kRow + i);
          std::memcpy(to + (first + i) * texel_bytes, packet.blend.texel(packet.member, lane),
                      std::min<std::size_t>(4, (kRow - i) * texel_bytes));
        }
        result.mask[first / 8] =
            static_cast<std::uint8_t>(result.mask[first / 8] | 0xFU << first % 8);
      }
      return;
    }
    projection::for_each_lane(lanes, [&](std::size_t i) {
      const std::uint16_t texel = packet.texels().texel[i];
      std::memcpy(to + texel * texel_bytes, packet.blend.texel(packet.member, static_cast<int>(i)),
                  texel_bytes);
      result.cover(texel);
    });
  }

  /// Writes what the texels of a packet hit, and returns how many have a value.
  std::uint64_t store_packet(const Packet& packet, shading::ResultBlock& result,
                             std::uint64_t& clipped) const {
    const std::size_t texel_bytes = packet.channel.format.texel_bytes();
    // Most lanes have what the output stores already.
    const unsigned ready =
        packet.channel.shape ? 0 : packet.hits & packet.blend.with_texels(packet.member);
    auto covered = static_cast<std::uint64_t>(std::popcount(ready));
    switch (texel_bytes) {
      case 1:
        copy_texels<1>(packet, ready, result);
        break;
      case 2:
        copy_texels<2>(packet, ready, result);
        break;
      case 3:
        copy_texels<3>(packet, ready, result);
        break;
      default:
        copy_texels<4>(packet, ready, result);
    }
    projection::for_each_lane(packet.hits & ~ready, [&](std::size_t i) {
      const std::uint16_t texel = packet.texels().texel[i];
      std::byte* const out = result.texels.data() + texel * texel_bytes;
      const int lane = static_cast<int>(i);
      const bool has_value = packet.channel.shape ? store_shape(packet, lane, out, clipped)
                                                  : store_colour(packet, lane, out, clipped);
      if (!has_value) return;
      result.cover(texel);
      ++covered;
    });
    return covered;
  }

  /// Writes the colour of one hit in the output's format and adds the samples that it cannot hold
  /// to `clipped`. False: it met a UDIM tile without image.
  bool store_colour(const Packet& packet, int lane, std::byte* out, std::uint64_t& clipped) const {
    // From the most special case to the most general one. Where several apply, all give the same
    // bits: it must not show which lanes happened to share a packet.
    const shading::TexelFormat& format = packet.channel.format;
    const PageColour& page = packet.page(lane);
    std::optional<shading::Factor> vertices;
    if (page.tinted) vertices = vertex_factor(packet.surface().colour(lane));
    const shading::Factor* const tint = vertices ? &*vertices : nullptr;
    if (is_constant(page)) {
      clipped += shading::store_texel(format, constant_value(page, tint, format), out);
      return true;
    }
    if (packet.blend.has_samples(packet.member, lane)) {
      clipped += shading::store_texel(format, lanes_value(packet, lane, format, tint), out);
      return true;
    }
    const PageImage image = packet.image(lane);
    if (image.column == nullptr) return false;
    const auto lookups = packet.lookups(image, lane);
    // Nothing changes the samples on their way into the output, so the integer sum itself is
    // rounded. With any conversion, factor or mean the value must stay unrounded until the output's
    // format stores it.
    if (lookups.single() && image.input == nullptr && !page.factor && !vertices &&
        format.keeps(image.directory())) {
      const ColourPlace at = packet.window().find(image);
      projection::Taps taps;
      lookup_.blend(at.rest_x, at.rest_y, taps);
      projection::sharpen(lookups.sharpening, at.rest_x, at.rest_y, taps);
      projection::blend_u8(*at.image, at.tile, at.column, at.row, taps, out);
    } else {
      clipped += shading::store_texel(
          format, value(page, image, lookups, format, packet.window(), tint), out);
    }
    return true;
  }

  /// What was looked up with the lanes beside it.
  static shading::TexelValue lanes_value(const Packet& packet, int lane,
                                         const shading::TexelFormat& format,
                                         const shading::Factor* tint = nullptr) {
    const ColourImage& image = packet.blend.image(packet.member, lane);
    return value_of(packet.page(lane), image.directory(), image.input,
                    packet.blend.samples(packet.member, lane),
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
  std::optional<shading::TexelValue> page_value(const Packet& packet, int lane) const {
    const PageColour& page = packet.page(lane);
    if (is_constant(page)) return page.constant;
    const shading::TexelFormat straight = read_format(packet.channel);
    if (packet.blend.has_samples(packet.member, lane)) return lanes_value(packet, lane, straight);
    const PageImage image = packet.image(lane);
    if (image.column == nullptr) return std::nullopt;
    return value(page, image, packet.lookups(image, lane), straight, packet.window());
  }

  /// The same as store_colour() for a channel of the surface itself.
  bool store_shape(const Packet& packet, int lane, std::byte* out, std::uint64_t& clipped) const {
    const shading::TexelFormat& format = packet.channel.format;
    const shading::ShapeOutput& shape = *packet.channel.shape;
    const projection::SurfacePacket& surface = packet.surface();
    if (!is_normal(shape)) {
      const shading::HitPoint at{surface.height[lane], surface.position(lane),
                                 surface.colour(lane)};
      clipped += shading::store_texel(format, shading::baked_value(shape, at), out);
      return true;
    }
    const auto map = page_value(packet, lane);
    if (!map) return false;
    const TangentFrame target = packet.frames->frame(packet.texels().texel[lane]);
    clipped += shading::store_texel(format,
                                    shading::transferred_normal(shape, packet.hit().page[lane],
                                                                *map, surface.frame(lane), target),
                                    out);
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

std::uint64_t shading_bytes(std::uint64_t colour_tile_bytes, std::size_t channels) {
  return colour_tile_bytes * (channels * ColourWindow::kTiles + 2) +
         ColourLevels::making_bytes(colour_tile_bytes);
}

HitShading::HitShading(job::JobContext& job, const store::GeometryStore& target,
                       std::vector<ChannelOutput> channels, const Lookup& lookup)
    : job_(&job),
      target_(&target),
      channels_(std::move(channels)),
      lookup_(lookup),
      groups_(group_channels(channels_, lookup_, most_together(job, channels_))) {}

std::uint64_t HitShading::result_texel_bytes() const {
  std::uint64_t bytes = 0;
  for (const ChannelOutput& channel : channels_) bytes += channel.format.texel_bytes();
  return bytes;
}

std::uint64_t HitShading::lookup_bytes() const {
  std::uint64_t most = 0;
  for (const LookupGroup& group : groups_) {
    std::uint64_t largest = 0;
    for (const LookedUpChannel& member : group.channels)
      largest = std::max(largest, most_tile_bytes(channels_[member.channel]));
    most = std::max(most, shading_bytes(largest, group.channels.size()));
  }
  return most;
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
  for (auto& stored : work.stored) stored.resize(work.blocks.size());
  for (const LookupGroup& group : groups_) {
    for (std::size_t b = 0; b < work.blocks.size(); ++b)
      blocks.shade_block(work, group, b, first_packet[b], first_packet[b + 1]);
  }
}

}  // namespace pounce::flow
