// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "flow/project/known_results.h"
#include "flow/project/page_projector.h"
#include "flow/stores/block_readers.h"
#include "flow/stores/views.h"
#include "projection/splat_blend.h"
#include "projection/splat_fit.h"
#include "shading/texel_input.h"
#include "store/blocks/splat_store.h"
#include "surface/strewn_places.h"

namespace pounce::flow {

/// The depth window's width, in units of the scene's surface noise.
inline constexpr float kWindowOverNoise = 2.5F;

/// One image of a page: colours, or evidence of them.
struct SplatOutput {
  Channel channel = Channel::base_color;
  shading::TexelFormat format;                ///< of the image, alpha and all
  std::optional<shading::ColourInput> input;  ///< from the scene's primaries, where they are others
};

struct SplatProjection {
  const SplatCache* source = nullptr;
  const store::GeometryStore* target = nullptr;
  std::vector<SplatOutput> outputs;
  bool linear = false;  ///< the scene's colours are linear light
  bool alpha = false;   ///< a texel's opacity is the alpha of its colour
  double fit = 1;       ///< of the scene at this target, 0..1: find_fit()
  projection::SplatLimits limits;
  const projection::SplatKernels* kernels = nullptr;
  float smallest_edge = 0;  ///< see TargetBlock
  bool in_turn = false;     ///< see looks_in_turn(); with views alone, which see most texels
  /// The scene from all around: texels that no view sees look along their normals. Null: all do.
  const SceneViews* views = nullptr;
  ResultKeeper* keeper = nullptr;  ///< null: nobody wants the results later

  std::size_t channels() const { return outputs.size(); }
  const shading::TexelFormat& format_of(std::size_t c) const { return outputs[c].format; }
  std::uint64_t packet_bytes(std::uint64_t packets) const {
    return projection::SplatState::most_bytes(packets, static_cast<std::uint64_t>(limits.rays));
  }
  /// Texels look along their normals a part of their piece after the other.
  bool looks_in_turn() const { return in_turn; }
  /// What texels hold beside that, whatever they look for: packets and what they have seen.
  std::uint64_t beside_bytes(std::uint64_t packets) const {
    return views == nullptr ? 0 : around_bytes(packets);
  }
  /// What a piece holds while it is looked up, beside all that is of its texels.
  std::uint64_t lookup_bytes() const { return views == nullptr ? 0 : kLookupBytes; }
  static std::uint64_t around_bytes(std::uint64_t packets) {
    return round_to_pages(packets * sizeof(surface::TexelPacket)) +
           round_to_pages(packets * sizeof(views::SightPacket)) +
           packets *
               (sizeof(std::uint32_t) + sizeof(views::PlacePacket) + sizeof(surface::PacketGroup));
  }
  static constexpr std::uint64_t kLookupBytes = SceneViews::kReadingBytes;
  std::uint64_t profile_bytes(std::uint64_t packets) const {
    return projection::SplatState::profile_bytes(packets, static_cast<std::uint64_t>(limits.rays));
  }
};

/// The texels of a target past the scene's blocks. `job` and what the request points to must
/// outlive it.
std::unique_ptr<Projection> project_splats(job::JobContext& job, const SplatProjection& request);

/// Does the scene lie at the surface where these places are? No without any places. They look as
/// far as request.limits say, `usual_reach` if nothing holds them back; `edge` is that of the
/// texels they stand for. Target, outputs and fit of the request do not count. Needs no more memory
/// than project_splats_least_bytes().
projection::SplatFit find_fit(job::JobContext& job, const SplatProjection& request,
                              std::span<const surface::Place> places, float edge,
                              float usual_reach);

/// The least that projecting needs at once: one target block, one block of a scene that has so many
/// lobes of harmonics, and so many rays beside each texel's normal. `result_texel_bytes`: of all
/// channels together; `from_around`: it has views.
std::uint64_t project_splats_least_bytes(std::uint64_t result_texel_bytes, std::size_t channels,
                                         std::uint32_t lobes, std::uint32_t rays, bool from_around);

}  // namespace pounce::flow
