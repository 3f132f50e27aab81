// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "flow/target_stream.h"
#include "mesh/uv_tiles.h"
#include "projection/blend.h"
#include "projection/search.h"
#include "tiles/colour_store.h"
#include "tiles/geometry_store.h"

namespace pounce::flow {

/// The UDIM tiles of a source texture: the source is seen through one lattice of such tiles, each
/// `width` x `height`; which image a hit means is found when it is blended. Blends do not reach
/// across a tile's border: every image is clamped, as renderers do.
struct TileColumns {
  std::uint32_t width = 0, height = 0;
  std::map<mesh::UvTile, const tiles::ColourStore*> tiles;
};

/// What one source page gives to one channel.
struct PageColour {
  const tiles::ColourStore* column = nullptr;
  const TileColumns* tile_set = nullptr;  ///< null as well as column: a constant
  texture::TexelValue constant;
};

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
