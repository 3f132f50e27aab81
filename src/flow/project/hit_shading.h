// SPDX-License-Identifier: Apache-2.0
//
// Hits become texels: what the images of each channel hold at the places that texels hit, in the
// output's format. Whether a search found the hits just now or a store kept them makes no
// difference to any bit.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "flow/project/packet_blend.h"
#include "flow/project/pieces.h"
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
/// What shading so many channels together asks for: the tiles that it keeps and one on its way, or
/// the making of a level.
std::uint64_t shading_bytes(std::uint64_t colour_tile_bytes, std::size_t channels = 1);

/// Makes texels of hits. Const members are thread-safe for different works.
class HitShading {
 public:
  /// `target`: read again for the frames of a normal map.
  HitShading(job::JobContext& job, const store::GeometryStore& target,
             std::vector<ChannelOutput> channels, const Lookup& lookup);

  // Groups point into the channels' pages.
  HitShading(const HitShading&) = delete;
  HitShading& operator=(const HitShading&) = delete;
  HitShading(HitShading&&) = default;
  HitShading& operator=(HitShading&&) = default;
  ~HitShading() = default;

  const std::vector<ChannelOutput>& channels() const { return channels_; }
  std::uint64_t result_texel_bytes() const;  ///< of all channels together
  std::uint64_t lookup_bytes() const;        ///< shading_bytes() of what asks for most
  /// Fills the work's results: every channel of every block.
  void shade(HitWork& work) const;

 private:
  job::JobContext* job_;
  const store::GeometryStore* target_;
  std::vector<ChannelOutput> channels_;
  Lookup lookup_;
  std::vector<LookupGroup> groups_;  ///< all channels, each in one
};

}  // namespace pounce::flow
