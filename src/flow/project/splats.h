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
  texture::TexelFormat format;  ///< of the one channel there is: colour, without alpha
  bool linear = false;          ///< the scene's colours are linear light
  projection::SplatLimits limits;
  const projection::SplatKernels* kernels = nullptr;
  float smallest_edge = 0;  ///< see TargetBlock
};

/// The texels of a target past the scene's blocks. `job` and what the request points to must
/// outlive it.
std::unique_ptr<Projection> project_splats(JobContext& job, const SplatProjection& request);

/// The least that projecting needs at once: one target block, one block of a scene that has so many
/// lobes of harmonics.
std::uint64_t project_splats_least_bytes(std::uint64_t result_texel_bytes, std::uint32_t lobes);

}  // namespace pounce::flow
