// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "flow/project/known_results.h"
#include "flow/project/page_projector.h"
#include "flow/stores/block_readers.h"
#include "projection/splat_blend.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// A mesh's texels, as Gaussians, onto a target: the paper's method.
struct GaussianProjection {
  const SplatCache* source = nullptr;
  const store::GeometryStore* target = nullptr;
  shading::TexelFormat format;  ///< of the one channel there is
  bool linear = false;          ///< the Gaussians' colours are
  bool has_alpha = false;       ///< some of the source's images have alpha
  projection::RayLimits limits;
  const projection::SplatKernels* kernels = nullptr;
  float smallest_edge = 0;         ///< see TargetBlock
  ResultKeeper* keeper = nullptr;  ///< null: nobody wants the results later

  static bool looks_in_turn() { return false; }
  static std::uint64_t beside_bytes(std::uint64_t) { return 0; }
  static std::uint64_t lookup_bytes() { return 0; }
  static std::uint64_t packet_bytes(std::uint64_t packets) {
    return projection::RayState::most_bytes(packets);
  }
  static std::uint64_t profile_bytes(std::uint64_t) { return 0; }  ///< this blend has none
  static std::size_t channels() { return 1; }
  const shading::TexelFormat& format_of(std::size_t) const { return format; }
};

/// How far a texel looks first: half the edge of a cell where a target's box has about one cell per
/// texel of its image.
float first_reach(double diagonal, ImageSize size);

/// The texels of a target past the blocks of Gaussians. `job` and what the request points to must
/// outlive it.
std::unique_ptr<Projection> project_gaussians(job::JobContext& job,
                                              const GaussianProjection& request);

/// The least that projecting needs at once: one target block, one block of Gaussians.
std::uint64_t project_gaussians_least_bytes(std::uint64_t result_texel_bytes);

}  // namespace pounce::flow
