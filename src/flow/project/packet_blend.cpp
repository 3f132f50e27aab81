// SPDX-License-Identifier: Apache-2.0
//
// Sixteen lookups side by side (docs/decisions/040-blend-lanes.md), for several images at once
// (docs/decisions/075-alike-channels.md).
//
// The lanes of a packet are close together on the target, so mostly they need the same image, the
// same level and the same tile. Nothing guarantees that. So lanes are grouped: by page and image
// here, then by level, then by tile in projection/blend_lanes.h. Each group is blended under a
// mask of its lanes, so a packet on a chart's border is as right as any.
//
// A lane gets one of three results: a finished texel (`rounded`), samples that shading has yet to
// convert (`blended`), or neither, and then it is blended alone. The last are lanes without an
// image: constants, UDIM tiles without image; and those of tents and of colours that are divided by
// their alpha, where images are deeper than 8 bits.
#include "flow/project/packet_blend.h"

#include <algorithm>
#include <bit>

namespace pounce::flow {
namespace {

using projection::FootprintLookupsLanes;
using projection::for_each_lane;
using projection::Sixteen;

std::size_t first_of(unsigned lanes) { return static_cast<std::size_t>(std::countr_zero(lanes)); }

// --- what is looked up together ------------------------------------------------------------------

/// May lanes of the image be looked up together with others?
bool may_join(const ColourImage& image, const shading::TexelFormat& format, double keys) {
  const store::ColourDirectory& directory = image.directory();
  if (directory.depth == Depth::u8) return true;
  return keys != projection::kTent &&
         (!directory.premultiplied || stays_premultiplied(directory, image.input, format));
}

ColourImage image_of(const PageColour& page) {
  return {page.column, page.input ? &*page.input : nullptr};
}

/// Every image of the page may.
bool may_join(const PageColour& page, const shading::TexelFormat& format, double keys) {
  if (page.column != nullptr) return may_join(image_of(page), format, keys);
  return std::all_of(page.tile_set->tiles.begin(), page.tile_set->tiles.end(), [&](const auto& of) {
    return may_join(image_in(*page.tile_set, of.first), format, keys);
  });
}

bool are_alike(const ColourCache& a, const ColourCache& b) {
  const store::ColourDirectory &x = a.store().directory(), &y = b.store().directory();
  return x.width == y.width && x.height == y.height && x.wrap_u == y.wrap_u &&
         x.wrap_v == y.wrap_v && store::is_float(x.depth) == store::is_float(y.depth);
}

/// Of pages that are no constants.
bool are_alike(const PageColour& a, const PageColour& b) {
  if (a.lattice != b.lattice || (a.column == nullptr) != (b.column == nullptr)) return false;
  if (a.column != nullptr) return are_alike(*a.column, *b.column);
  return std::equal(a.tile_set->tiles.begin(), a.tile_set->tiles.end(), b.tile_set->tiles.begin(),
                    b.tile_set->tiles.end(), [](const auto& x, const auto& y) {
                      return x.first == y.first && are_alike(*x.second.column, *y.second.column);
                    });
}

}  // namespace

bool LookupGroup::add(const LookedUpChannel& channel, const Lookup& lookup, std::size_t most) {
  if (channels.size() == most) return false;
  std::vector<Page> with = pages;
  with.resize(channel.pages->size());
  for (std::size_t p = 0; p < with.size(); ++p) {
    const PageColour& page = (*channel.pages)[p];
    if (is_constant(page)) continue;
    const Page added{&page, may_join(page, channel.format, projection::keys_of(lookup.blend))};
    if (with[p].page == nullptr) {
      with[p] = added;
    } else if (with[p].joins != added.joins || !are_alike(*with[p].page, page)) {
      return false;
    }
  }
  pages = std::move(with);
  channels.push_back(channel);
  return true;
}

// --- packets -------------------------------------------------------------------------------------

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

PacketBlend::PacketBlend(const LookupGroup& group, const Lookup& lookup)
    : group_(group),
      lanes_(*lookup.lanes),
      keys_(projection::keys_of(lookup.blend)),
      levels_(*lookup.levels),
      own_(group.channels.size()) {}

void PacketBlend::look_up(const projection::HitPacket& hit, const surface::TexelPacket& texels,
                          unsigned hits, const std::vector<surface::TexelAxes>& axes) {
  for (Own& own : own_) own.found = own.kept = own.alone = own.rounded = own.blended = 0;
  const Mask found = find_images(hit, hits);
  if (found == 0) return;
  find_footprints(hit, texels, axes, found);
  lanes_.lookups(footprints_, last_level_, lookups_);
  for (Own& own : own_) {
    for (auto& samples : own.means) samples.fill(0);
  }
  for (Mask left = found; left != 0;) {
    const std::size_t first = first_of(left);
    const Mask lanes = only_page_ != kNoPage ? left : like(first, left);
    left &= ~lanes;
    choose_images(first, lanes);
    if (const Mask single = lanes & lookups_.single; single != 0) add_single(hit, single);
    for (std::size_t s = 0; s < 2; ++s) {
      // The second set is that of the next level, mixed in near the end of a level's range
      // (docs/decisions/033-footprints.md).
      Mask several = lanes & ~lookups_.single & (s == 0 ? ~0U : lookups_.two);
      while (several != 0) {
        const std::int32_t number = lookups_.sets[s].level[first_of(several)];
        const Mask level = several & projection::lanes_with(lookups_.sets[s].level, number);
        add_set(s, static_cast<std::uint32_t>(number), level);
        several &= ~level;
      }
    }
  }
  for (std::size_t c = 0; c < own_.size(); ++c) finish(c);
}

projection::Blended PacketBlend::samples(std::size_t c, int lane) const {
  const auto i = static_cast<std::size_t>(lane);
  const projection::MeansLanes& means = own_[c].means;
  return {means[0][i], means[1][i], means[2][i], means[3][i]};
}

/// Whether all hits are on one page that has one image; then finds where they look, if lanes may.
bool PacketBlend::find_one_image(const projection::HitPacket& hit, Mask hits) {
  const std::int32_t number = hit.page[first_of(hits)];
  std::uint32_t others = 0;
  for (std::size_t lane = 0; lane < surface::kLanes; ++lane)
    others |= hit.page[lane] != number ? projection::kLaneBit[lane] : 0;
  if ((others & hits) != 0) return false;
  const LookupGroup::Page& of = group_.pages[static_cast<std::size_t>(number)];
  if (!of.joins || of.page->column == nullptr) return false;
  const store::ColourDirectory& image = of.page->column->store().directory();
  if (only_page_ != number) {
    only_page_ = number;
    is_chosen_ = false;
    const Vec2d scale = scale_of(of.page->lattice, image);
    pages_.fill(number);
    tiles_.fill({});
    scales_.x.fill(scale.x);
    scales_.y.fill(scale.y);
    last_level_.fill(static_cast<std::int32_t>(shading::last_level(image)));
  }
  // As middle_of(), in loops that become vectors. The other lanes, of which nothing is known, at 0.
  projection::Vec2Lanes at;
  for (std::size_t lane = 0; lane < surface::kLanes; ++lane) {
    const bool is_hit = (hits & projection::kLaneBit[lane]) != 0;
    at.x[lane] =
        static_cast<double>(is_hit ? hit.base_x[lane] : 0) + (is_hit ? hit.frac_x[lane] : 0.0F);
    at.y[lane] =
        static_cast<double>(is_hit ? hit.base_y[lane] : 0) + (is_hit ? hit.frac_y[lane] : 0.0F);
  }
  if (!is_of_size(image, of.page->lattice)) {
    for (std::size_t lane = 0; lane < surface::kLanes; ++lane) {
      at.x[lane] = (at.x[lane] + 0.5) * scales_.x[lane] - 0.5;
      at.y[lane] = (at.y[lane] + 0.5) * scales_.y[lane] - 0.5;
    }
  }
  middles_ = at;
  return true;
}

/// The lanes whose images may be looked up together with others, and where they look.
PacketBlend::Mask PacketBlend::find_images(const projection::HitPacket& hit, Mask hits) {
  if (hits == 0) return 0;
  if (find_one_image(hit, hits)) return hits;
  only_page_ = kNoPage;
  Mask found = 0;
  // Neighbouring lanes mostly share an image: what is asked of it is asked once.
  std::int32_t page = -1, last_level = 0;
  LookupGroup::Page of;
  Vec2d scale;
  const store::ColourDirectory* image = nullptr;
  for_each_lane(hits, [&](std::size_t lane) {
    const int l = static_cast<int>(lane);
    if (hit.page[l] != page) {
      page = hit.page[l];
      of = group_.pages[static_cast<std::size_t>(page)];
      if (of.joins && of.page->column != nullptr) {
        image = &of.page->column->store().directory();
        scale = scale_of(of.page->lattice, *image);
        last_level = static_cast<std::int32_t>(shading::last_level(*image));
      }
    }
    if (!of.joins) return;
    Vec2d middle;
    if (of.page->column != nullptr) {
      middle = middle_of(place_of(hit, l), of.page->lattice, *image, scale);
      tiles_[lane] = {};
    } else {
      const PageImage at = image_at(*of.page, place_of(hit, l));
      if (at.column == nullptr) return;
      middle = at.middle;
      scale = at.scale;
      tiles_[lane] = at.tile;
      last_level = static_cast<std::int32_t>(shading::last_level(at.directory()));
    }
    pages_[lane] = page;
    middles_.x[lane] = middle.x;
    middles_.y[lane] = middle.y;
    scales_.x[lane] = scale.x;
    scales_.y[lane] = scale.y;
    last_level_[lane] = last_level;
    found |= 1U << lane;
  });
  return found;
}

void PacketBlend::find_footprints(const projection::HitPacket& hit,
                                  const surface::TexelPacket& texels,
                                  const std::vector<surface::TexelAxes>& axes, Mask lanes) {
  if (axes.empty()) {  // texels that are known by their edge alone
    for_each_lane(lanes, [&](std::size_t lane) {
      const auto [a, b] = footprint_at(hit, texels, axes, static_cast<int>(lane));
      footprints_.ax[lane] = a.x * scales_.x[lane];
      footprints_.ay[lane] = a.y * scales_.y[lane];
      footprints_.bx[lane] = b.x * scales_.x[lane];
      footprints_.by[lane] = b.y * scales_.y[lane];
    });
    return;
  }
  for_each_lane(lanes, [&](std::size_t lane) {
    const surface::TexelAxes& own = axes[texels.owner[lane]];
    axes_.x[0][lane] = own.x.x;
    axes_.x[1][lane] = own.x.y;
    axes_.x[2][lane] = own.x.z;
    axes_.y[0][lane] = own.y.x;
    axes_.y[1][lane] = own.y.y;
    axes_.y[2][lane] = own.y.z;
  });
  lanes_.footprints(hit, axes_, scales_, lanes, footprints_);
}

/// The lanes that are of the same page and tile.
PacketBlend::Mask PacketBlend::like(std::size_t lane, Mask among) const {
  Mask out = 0;
  for_each_lane(among, [&](std::size_t i) {
    if (pages_[i] == pages_[lane] && tiles_[i] == tiles_[lane]) out |= 1U << i;
  });
  return out;
}

/// Each channel's image of such lanes.
void PacketBlend::choose_images(std::size_t first, Mask lanes) {
  const bool is_only = only_page_ != kNoPage;
  for (std::size_t c = 0; c < own_.size(); ++c) {
    Own& own = own_[c];
    if (is_only && is_chosen_) {
      if (own.image.column != nullptr) own.found = lanes;
      if (own.keeps) own.kept = lanes;
      continue;
    }
    own.keeps = false;
    const LookedUpChannel& channel = group_.channels[c];
    const PageColour& page = (*channel.pages)[static_cast<std::size_t>(pages_[first])];
    own.image = page.tile_set != nullptr ? image_in(*page.tile_set, tiles_[first]) : image_of(page);
    if (own.image.column == nullptr) continue;
    const store::ColourDirectory& image = own.image.directory();
    directory_ = &image;
    own.add = lanes_.add[static_cast<std::size_t>(image.depth)][image.channels - 1];
    if (is_only) {
      own.images.fill(own.image);
    } else {
      for_each_lane(lanes, [&](std::size_t lane) { own.images[lane] = own.image; });
    }
    own.found |= lanes;
    // Where the output stores samples as the image holds them, one lookup is rounded from its
    // integer sum at once. A mean of several is a sum of doubles: it is rounded at the end, when
    // all sets were added.
    own.keeps = channel.rounds && own.image.input == nullptr && !page.factor && !page.tinted &&
                channel.format.keeps(image);
    if (own.keeps) own.kept |= lanes;
  }
  is_chosen_ = is_only;
}

/// One lookup for each of the lanes, in the chosen images themselves.
void PacketBlend::find_places(const PageColour& page, const projection::HitPacket& hit,
                              Mask lanes) {
  const store::ColourDirectory& image = *directory_;
  const auto wrapped = [&](std::size_t lane) {
    const Vec2d middle{middles_.x[lane], middles_.y[lane]};
    return wrapped_in(image, page.lattice, place_of(hit, static_cast<int>(lane)), middle);
  };
  const auto set = [&](std::size_t lane, const auto& at) { places_.set_place(lane, at.x, at.y); };
  if (page.column != nullptr && is_of_size(image, page.lattice)) {
    lanes_.place_hits(hit, {image.width, image.height}, lanes, places_);
    for_each_lane(places_.outside, [&](std::size_t lane) { set(lane, wrapped(lane)); });
    return;
  }
  places_.offset.fill(0);
  places_.share.fill(0);
  places_.active = lanes;
  for_each_lane(lanes, [&](std::size_t lane) {
    if (page.column != nullptr) {
      set(lane, wrapped(lane));
    } else {
      set(lane, image_at(page, place_of(hit, static_cast<int>(lane))));
    }
    places_.share[lane] = 1;
  });
}

/// Adds lookups in the chosen images themselves, one for each of the lanes.
void PacketBlend::add_single(const projection::HitPacket& hit, Mask lanes) {
  const PageColour& page = *group_.pages[static_cast<std::size_t>(pages_[first_of(lanes)])].page;
  find_places(page, hit, lanes);
  const bool floats = store::is_float(directory_->depth);
  if (floats) places_.settle();
  lanes_.weigh(places_, keys_, projection::sharpening_of(lookups_, lanes), weights_);
  for (Own& own : own_) {
    if (own.image.column == nullptr) continue;
    const store::ColourDirectory& image = own.image.directory();
    projection::for_each_tile(
        places_,
        [&](std::uint32_t x, std::uint32_t y) { return own.window.tile(*own.image.column, x, y); },
        [&](const std::byte* tile, const Sixteen<double>& share, Mask same) {
          if (!own.keeps) return own.add(tile, places_, weights_, share, own.means);
          alignas(64) Sixteen<std::uint32_t> rounded;
          lanes_.round_u8[image.channels - 1](tile, places_, weights_, rounded);
          projection::replace(same, rounded, own.texels);
        });
    if (!floats) continue;
    // A 0 may have another sign than one lookup alone.
    for_each_lane(lanes, [&](std::size_t lane) {
      for (std::size_t c = 0; c < image.channels; ++c)
        own.alone |= (own.means[c][lane] == 0 ? 1U : 0U) << lane;
    });
  }
}

/// Adds a set of lookups of lanes that have one level of the chosen images.
void PacketBlend::add_set(std::size_t s, std::uint32_t number, Mask lanes) {
  const store::ColourDirectory& image = *directory_;
  const store::ColourDirectory* smaller = &image;
  for (Own& own : own_) {
    own.level = own.image.column;
    if (own.level == nullptr || number == 0) continue;
    own.level = &levels_.get(*own.level, number);
    smaller = &own.level->store().directory();
  }
  const projection::LookedUp in{image.width,
                                image.height,
                                smaller->width,
                                smaller->height,
                                image.wrap_u,
                                image.wrap_v,
                                store::is_float(image.depth)};
  projection::for_each_lookup(
      lanes_, keys_, lookups_.sets[s],
      number == 0 ? projection::sharpening_of(lookups_, lanes) : projection::SharpeningLanes{}, in,
      middles_, lanes, places_, weights_, [&] {
        for (Own& own : own_) {
          if (own.level == nullptr) continue;
          projection::for_each_tile(
              places_,
              [&](std::uint32_t x, std::uint32_t y) { return own.window.tile(*own.level, x, y); },
              [&](const std::byte* tile, const Sixteen<double>& share, Mask) {
                own.add(tile, places_, weights_, share, own.means);
              });
        }
      });
}

/// Rounds what is rounded, and says what became of the lanes.
void PacketBlend::finish(std::size_t c) {
  Own& own = own_[c];
  own.blended = own.found & ~(own.kept & lookups_.single) & ~own.alone;
  own.rounded = own.kept;
  const Mask means = own.kept & ~lookups_.single;
  if (means == 0) return;
  Sixteen<std::uint32_t> rounded;
  lanes_.round_means(own.means, group_.channels[c].format.channels, rounded);
  projection::replace(means, rounded, own.texels);
}

}  // namespace pounce::flow
