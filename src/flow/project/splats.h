// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "flow/project/page_projector.h"
#include "flow/project/source_readers.h"
#include "projection/splat_blend.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// The depth window's width, in units of the scene's surface noise.
inline constexpr float kWindowOverNoise = 2.5F;

struct SplatProjection {
  const SplatCache* source = nullptr;
  const store::GeometryStore* target = nullptr;
  texture::TexelFormat format;  ///< of the one channel there is: colour
  bool linear = false;          ///< the scene's colours are linear light
  bool alpha = false;           ///< a texel's opacity is its alpha
  projection::SplatLimits limits;
  const projection::SplatKernels* kernels = nullptr;
  float smallest_edge = 0;  ///< see TargetBlock

  std::uint64_t packet_bytes(std::uint64_t packets) const {
    return projection::SplatState::most_bytes(packets, static_cast<std::uint64_t>(limits.rays));
  }
};

/// The texels of a target past the scene's blocks. `job` and what the request points to must
/// outlive it.
std::unique_ptr<Projection> project_splats(JobContext& job, const SplatProjection& request);

/// The least that projecting needs at once: one target block, one block of a scene that has so many
/// lobes of harmonics, and so many rays beside each texel's normal.
std::uint64_t project_splats_least_bytes(std::uint64_t result_texel_bytes, std::uint32_t lobes,
                                         std::uint32_t rays);

}  // namespace pounce::flow
