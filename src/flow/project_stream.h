// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "flow/job_context.h"
#include "projection/blend.h"
#include "projection/search.h"
#include "texture/result_block.h"
#include "tiles/colour_store.h"
#include "tiles/geometry_store.h"

namespace pounce::flow {

/// What one source page gives to one channel.
struct PageColour {
  const tiles::ColourStore* column = nullptr;  ///< null: a constant
  texture::TexelValue constant;
};

/// One channel that a pass transfers.
struct ChannelOutput {
  texture::TexelFormat format;
  std::vector<PageColour> pages;  ///< by source page
};

/// Where the result blocks of one channel are, by target page and block; written in any order.
struct ResultIndex {
  /// [page][block_y * blocks_x + block_x]; raw_bytes == 0: nothing covered there.
  std::vector<std::vector<tiles::ChunkRef>> pages;
};

struct ProjectRequest {
  const tiles::GeometryStore* source = nullptr;
  const tiles::GeometryStore* target = nullptr;
  std::vector<ChannelOutput> channels;
  projection::SearchLimits limits;
  const projection::Kernels* kernels = nullptr;
  projection::BlendKernel blend = projection::tent;
  float smallest_edge = 0;  ///< see TargetBlock
};

struct ProjectResult {
  std::unique_ptr<tiles::PackReader> pack;  ///< scratch
  std::vector<ResultIndex> channels;        ///< as requested
  std::uint64_t covered = 0;
};

/// Streams the target's tiles past the source's blocks: search, blend, result blocks into a scratch
/// pack.
ProjectResult project(JobContext& job, const ProjectRequest& request);

/// The least that projecting needs at once: one target block, one source block at a time, its
/// colours.
std::uint64_t project_least_bytes(std::uint32_t most_triangles, std::uint32_t most_patches,
                                  std::uint32_t largest_chunk_bytes,
                                  std::uint64_t result_texel_bytes,
                                  std::uint64_t colour_tile_bytes);

}  // namespace pounce::flow
