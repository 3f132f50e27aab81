// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "flow/job_context.h"
#include "io/image_read.h"
#include "mesh/block_bins.h"
#include "tiles/colour_store.h"
#include "tiles/geometry_store.h"

namespace pounce::flow {

/// A mesh as one pass sees it: its pages and which triangles each has.
struct GeometryRequest {
  const mesh::Mesh* mesh = nullptr;
  std::vector<mesh::Lattice> pages;
  std::vector<std::uint32_t> triangle_page;  ///< see mesh::BinRequest
  bool is_target = false;
  std::optional<mesh::TilePages> tile_pages;  ///< target of many UDIMs
};

/// Key of a geometry store: content of the mesh, pages, selection, side.
Hash128 geometry_key(const GeometryRequest& request);
/// Preconditions a source or vectorizes a target into a store, or finds it in the cache.
std::unique_ptr<tiles::GeometryStore> geometry_store(JobContext& job,
                                                     const GeometryRequest& request, bool* cached);
/// The least that the work above may need at once, from bin counts.
std::uint64_t geometry_least_bytes(const GeometryRequest& request, std::uint64_t tile_cap_bytes);
/// What a geometry store holds, before compression.
struct GeometrySize {
  std::uint64_t bytes = 0;
  std::uint64_t chunks = 0;
};
/// The most that such a store holds.
GeometrySize geometry_most(const GeometryRequest& request);

/// One source image as a column of the source store.
struct ColourRequest {
  const mesh::ImageRef* image = nullptr;
  const io::ImageInfo* info = nullptr;  ///< of that image
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
};
/// Builds the column or finds it in the cache.
std::unique_ptr<tiles::ColourStore> colour_store(JobContext& job, const ColourRequest& request,
                                                 bool* cached);
/// What building a column of such an image needs at once, at least.
std::uint64_t colour_least_bytes(std::uint32_t width, std::uint64_t texel_bytes,
                                 std::uint64_t decoder_bytes);

}  // namespace pounce::flow
