// SPDX-License-Identifier: Apache-2.0
//
// The images' samples where sixteen texels hit: lookups of all of them at once where images and
// kernel allow it, to the bits that one by one gives (docs/decisions/040-blend-lanes.md).
//
// Channels whose images are alike are looked up together: where, in which level and with which
// weights is found out once, and then each adds the samples of its own image.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "flow/project/page_colour.h"
#include "projection/blend.h"
#include "projection/blend_lanes.h"
#include "projection/hit_packet.h"
#include "surface/target_block.h"

namespace pounce::flow {

/// What shading looks images up with.
struct Lookup {
  const projection::BlendLanes* lanes = nullptr;
  projection::BlendKernel blend = projection::kernel_of(kDefaultFilter);
  ColourLevels* levels = nullptr;  ///< of the channels' columns
};

/// The lane's texel and its hit's page are there.
inline bool is_hit(const projection::HitPacket& hit, const surface::TexelPacket& texels, int lane) {
  return texels.texel[lane] != surface::kNoTexel && hit.key[lane] != projection::kNoHit;
}

/// The lanes for which it holds, as bits.
inline unsigned hits_of(const projection::HitPacket& hit, const surface::TexelPacket& texels) {
  // Two loops, each of one type: both become vector code.
  std::uint32_t lanes = 0;
  std::uint16_t unused = 0;
  for (std::size_t lane = 0; lane < surface::kLanes; ++lane) {
    lanes |= hit.key[lane] != projection::kNoHit ? projection::kLaneBit[lane] : 0;
    const auto bit = static_cast<std::uint16_t>(projection::kLaneBit[lane]);
    unused |= texels.texel[lane] == surface::kNoTexel ? bit : std::uint16_t{0};
  }
  return lanes & ~std::uint32_t{unused};
}

inline PagePlace place_of(const projection::HitPacket& hit, int lane) {
  return {hit.base_x[lane], hit.base_y[lane], hit.frac_x[lane], hit.frac_y[lane]};
}

/// What the texel in a lane covers of the image that its hit lies in. `axes` are of its block.
projection::Footprint footprint_at(const projection::HitPacket& hit,
                                   const surface::TexelPacket& texels,
                                   const std::vector<surface::TexelAxes>& axes, int lane);

/// A channel whose images are looked up.
struct LookedUpChannel {
  std::size_t channel = 0;                         ///< of the pass
  const std::vector<PageColour>* pages = nullptr;  ///< by source page; not owned
  shading::TexelFormat format;                     ///< what they are read for
  /// Where the format takes samples as they are, they become texels at once.
  bool rounds = false;
};

/// Channels that are looked up together.
struct LookupGroup {
  /// Each keeps tiles of its own at hand: more than these gain little.
  static constexpr std::size_t kMost = 4;

  /// What its channels have on a source page.
  struct Page {
    const PageColour* page = nullptr;  ///< of one that has images there, if one has; not owned
    bool joins = false;                ///< lanes may be looked up together
  };
  std::vector<LookedUpChannel> channels;
  std::vector<Page> pages;

  /// Adds a channel unless there are `most`, if on every page it has no image or such as the others
  /// have there: of their size, wrap modes and kind of samples.
  bool add(const LookedUpChannel& channel, const Lookup& lookup, std::size_t most = kMost);
};

/// Blends packets, one after the other, for a group's channels, counted as there. One per thread.
class PacketBlend {
 public:
  PacketBlend(const LookupGroup& group, const Lookup& lookup);

  /// Looks up what the packet's `hits` have in the images, where lanes may.
  void look_up(const projection::HitPacket& hit, const surface::TexelPacket& texels, unsigned hits,
               const std::vector<surface::TexelAxes>& axes);

  /// Lanes that have a texel, and what else became of one. Neither: it is to be blended alone.
  unsigned with_texels(std::size_t c) const { return own_[c].rounded; }
  bool has_samples(std::size_t c, int lane) const { return (own_[c].blended >> lane & 1) != 0; }
  /// As the output stores it: up to four channels of 8 bits.
  const std::byte* texel(std::size_t c, int lane) const {
    return reinterpret_cast<const std::byte*>(&own_[c].texels[static_cast<std::size_t>(lane)]);
  }
  projection::Blended samples(std::size_t c, int lane) const;
  /// What the samples are of.
  const ColourImage& image(std::size_t c, int lane) const {
    return own_[c].images[static_cast<std::size_t>(lane)];
  }
  /// For lanes that are blended alone.
  ColourWindow& window(std::size_t c) { return own_[c].window; }

 private:
  using Mask = unsigned;  ///< a bit per lane
  static constexpr std::int32_t kNoPage = -1;

  /// A channel's part of it. A channel of a block begins with an empty window of decoded tiles, in
  /// which most lookups of the block find their tile.
  struct Own {
    Mask found = 0, kept = 0, alone = 0;
    Mask rounded = 0, blended = 0;
    // Of the lanes that are looked up now:
    ColourImage image;
    const ColourCache* level = nullptr;
    bool keeps = false;
    projection::BlendLanes::Add add = nullptr;
    std::array<ColourImage, surface::kLanes> images{};
    projection::MeansLanes means{};
    alignas(64) projection::Sixteen<std::uint32_t> texels{};
    ColourWindow window;
  };

  Mask find_images(const projection::HitPacket& hit, Mask hits);
  bool find_one_image(const projection::HitPacket& hit, Mask hits);
  Mask like(std::size_t lane, Mask among) const;
  void find_footprints(const projection::HitPacket& hit, const surface::TexelPacket& texels,
                       const std::vector<surface::TexelAxes>& axes, Mask lanes);
  void choose_images(std::size_t first, Mask lanes);
  void find_places(const PageColour& page, const projection::HitPacket& hit, Mask lanes);
  void add_single(const projection::HitPacket& hit, Mask lanes);
  void add_set(std::size_t s, std::uint32_t number, Mask lanes);
  void finish(std::size_t c);

  const LookupGroup& group_;
  const projection::BlendLanes& lanes_;
  const double keys_;
  ColourLevels& levels_;
  std::vector<Own> own_;
  std::int32_t only_page_ = kNoPage;  ///< that all lanes below are of, with one image
  bool is_chosen_ = false;            ///< that page's images
  projection::Sixteen<std::int32_t> pages_{};
  projection::Sixteen<mesh::UvTile> tiles_{};
  projection::Vec2Lanes middles_{}, scales_{};
  projection::AxesLanes axes_{};
  projection::FootprintLanes footprints_{};
  projection::Sixteen<std::int32_t> last_level_{};
  const store::ColourDirectory* directory_ = nullptr;  ///< of the images that are looked up now
  projection::FootprintLookupsLanes lookups_{};
  projection::PlacesLanes places_{};
  projection::WeightsLanes weights_{};
};

}  // namespace pounce::flow
