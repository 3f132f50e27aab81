// SPDX-License-Identifier: Apache-2.0
//
// Hits become texels: what the images of each channel hold at the places that texels hit, in the
// output's format. Whether a search found the hits just now or a store kept them makes no
// difference to any bit.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "flow/project/page_colour.h"
#include "flow/project/pieces.h"
#include "projection/blend.h"
#include "projection/blend_lanes.h"
#include "projection/hit_packet.h"
#include "projection/search.h"
#include "shading/shape_output.h"
#include "store/blocks/geometry_store.h"
#include "surface/target_block.h"
#include "surface/texel_frames.h"

namespace pounce::flow {

/// One channel that a pass transfers.
struct ChannelOutput {
  shading::TexelFormat format;
  std::vector<PageColour> pages;              ///< by source page
  std::optional<shading::ShapeOutput> shape;  ///< nothing: what the pages give is what is written
  bool is_map = false;                        ///< of the hits themselves: projection::map_texel()
};

/// What shading looks images up with.
struct Lookup {
  const projection::BlendLanes* lanes = nullptr;
  projection::BlendKernel blend = projection::kernel_of(kDefaultFilter);
  ColourLevels* levels = nullptr;  ///< of the channels' columns
};

/// A piece whose texels have hits.
struct HitWork : PieceWork {
  projection::SearchState state;
  std::vector<std::vector<surface::TexelAxes>> axes;  ///< by block
  projection::SurfacePoints points;                   ///< where some channel needs_points()
};

/// Is the channel of the surface itself, or tinted by the colours of its vertices?
bool needs_surface(const ChannelOutput& channel);
/// Does it ask where on the surface hits are? The same, or a map of them.
bool needs_points(const ChannelOutput& channel);
/// What shading asks for: the tiles that it keeps and one on its way, or the making of a level.
std::uint64_t shading_bytes(std::uint64_t colour_tile_bytes);

/// Makes texels of hits. Const members are thread-safe for different works.
class HitShading {
 public:
  /// `target`: read again for the frames of a normal map.
  HitShading(job::JobContext& job, const store::GeometryStore& target,
             std::vector<ChannelOutput> channels, const Lookup& lookup);

  const std::vector<ChannelOutput>& channels() const { return channels_; }
  std::uint64_t result_texel_bytes() const;  ///< of all channels together
  std::uint64_t lookup_bytes() const;        ///< shading_bytes() of the largest tile
  /// Fills the work's results: every channel of every block.
  void shade(HitWork& work) const;

 private:
  job::JobContext* job_;
  const store::GeometryStore* target_;
  std::vector<ChannelOutput> channels_;
  Lookup lookup_;
};

// --- sixteen lookups side by side ----------------------------------------------------------------
//
// The images' samples where sixteen texels hit: lookups of all of them at once where images and
// kernel allow it, to the bits that one by one gives.

/// The lane's texel and its hit's page are there.
inline bool is_hit(const projection::HitPacket& hit, const surface::TexelPacket& texels, int lane) {
  return texels.texel[lane] != surface::kNoTexel && hit.key[lane] != projection::kNoHit;
}

inline PagePlace place_of(const projection::HitPacket& hit, int lane) {
  return {hit.base_x[lane], hit.base_y[lane], hit.frac_x[lane], hit.frac_y[lane]};
}

/// What the texel in a lane covers of the image that its hit lies in. `axes` are of its block.
projection::Footprint footprint_at(const projection::HitPacket& hit,
                                   const surface::TexelPacket& texels,
                                   const std::vector<surface::TexelAxes>& axes, int lane);

/// Blends packets, one after the other. One per thread.
class PacketBlend {
 public:
  PacketBlend(const projection::BlendLanes& lanes, projection::BlendKernel kernel,
              ColourLevels& levels)
      : lanes_(lanes), keys_(projection::keys_of(kernel)), levels_(levels) {}

  /// Looks up what the packet's hits have in the images of `pages`, where lanes may. Where `format`
  /// takes samples as they are, they are rounded if `rounds`.
  void look_up(std::span<const PageColour> pages, const projection::HitPacket& hit,
               const surface::TexelPacket& texels, const std::vector<surface::TexelAxes>& axes,
               const shading::TexelFormat& format, bool rounds, ColourWindow& window);

  /// What became of a lane. Neither: it is to be blended alone.
  bool has_texel(int lane) const { return (rounded_ >> lane & 1) != 0; }
  bool has_samples(int lane) const { return (blended_ >> lane & 1) != 0; }
  /// As the output stores it: up to four channels of 8 bits.
  const std::byte* texel(int lane) const {
    return reinterpret_cast<const std::byte*>(&texels_[static_cast<std::size_t>(lane)]);
  }
  projection::Blended samples(int lane) const;
  const PageImage& image(int lane) const { return images_[static_cast<std::size_t>(lane)]; }

 private:
  using Mask = unsigned;  ///< a bit per lane

  Mask find_images(std::span<const PageColour> pages, const projection::HitPacket& hit,
                   const surface::TexelPacket& texels, const std::vector<surface::TexelAxes>& axes,
                   const shading::TexelFormat& format);
  bool may_join(const PageImage& image, const shading::TexelFormat& format) const;
  Mask like(std::size_t lane, Mask among) const;
  Mask signed_zeros(std::size_t first, Mask lanes) const;
  bool keeps(std::size_t lane, const shading::TexelFormat& format) const;
  void add_set(std::size_t s, std::size_t first, Mask lanes, ColourWindow& window);
  void add_single(std::size_t first, Mask lanes, bool rounds, ColourWindow& window);
  const projection::FootprintLookupsLanes* sharpening(Mask lanes) const;

  const projection::BlendLanes& lanes_;
  const double keys_;
  ColourLevels& levels_;
  Mask rounded_ = 0, blended_ = 0;
  std::array<const PageColour*, surface::kLanes> pages_{};
  std::array<PageImage, surface::kLanes> images_;
  projection::FootprintLanes footprints_{};
  projection::Sixteen<std::int32_t> last_level_{};
  projection::MiddlesLanes middles_{};
  projection::FootprintLookupsLanes lookups_{};
  projection::PlacesLanes places_{};
  projection::MeansLanes means_{};
  alignas(64) projection::Sixteen<std::uint32_t> texels_{};
};

}  // namespace pounce::flow
