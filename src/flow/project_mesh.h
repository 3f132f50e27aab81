// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "flow/page_colour.h"
#include "flow/target_stream.h"
#include "projection/blend.h"
#include "projection/search.h"
#include "tiles/geometry_store.h"

namespace pounce::flow {

/// One channel that a pass transfers.
struct ChannelOutput {
  texture::TexelFormat format;
  std::vector<PageColour> pages;  ///< by source page
};

struct MeshProjection {
  const tiles::GeometryStore* source = nullptr;
  const tiles::GeometryStore* target = nullptr;
  std::vector<ChannelOutput> channels;
  projection::SearchLimits limits;
  const projection::Kernels* kernels = nullptr;
  projection::BlendKernel blend = projection::tent;
  float smallest_edge = 0;  ///< see TargetBlock
};

/// Streams the target past the source's blocks: search, blend, result blocks. `job` must outlive
/// it.
std::unique_ptr<PageProjector> project_mesh(JobContext& job, MeshProjection request);

/// The least that projecting needs at once: one target block, one source block at a time, its
/// colours.
std::uint64_t project_least_bytes(std::uint32_t most_triangles, std::uint32_t most_patches,
                                  std::uint32_t largest_chunk_bytes,
                                  std::uint64_t result_texel_bytes,
                                  std::uint64_t colour_tile_bytes);

}  // namespace pounce::flow
