// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "flow/project/hit_shading.h"
#include "flow/project/page_projector.h"
#include "flow/stores/block_readers.h"
#include "projection/search.h"
#include "store/blocks/geometry_store.h"

namespace pounce::flow {

struct MeshProjection {
  const SurfaceCache* source = nullptr;  ///< with attributes, if some channel has a shape
                                         ///< or is tinted
  const store::GeometryStore* target = nullptr;
  std::vector<ChannelOutput> channels;
  projection::SearchLimits limits;
  const projection::Kernels* kernels = nullptr;
  Lookup lookup;
  float smallest_edge = 0;  ///< see TargetBlock
};

/// The texels of a target past the source's blocks. `job` and what the request points to must
/// outlive it.
std::unique_ptr<Projection> project_mesh(job::JobContext& job, const MeshProjection& request);

/// The least that projecting needs at once: one target block, one source block at a time, its
/// colours (shading_bytes()). `with_shape`: some channel is of the surface itself, or tinted.
std::uint64_t project_least_bytes(std::uint32_t most_triangles, std::uint32_t largest_chunk_bytes,
                                  std::uint64_t result_texel_bytes, std::uint64_t lookup_bytes,
                                  bool with_shape);

}  // namespace pounce::flow
