// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "io/image/read.h"
#include "job/job_context.h"
#include "mesh/block_bins.h"
#include "mesh/touched_tiles.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_store.h"

namespace pounce::flow {

/// The content of a mesh as part of keys, hashed when it is first asked for. Not thread-safe.
class MeshHashes {
 public:
  explicit MeshHashes(const mesh::Mesh& mesh) : mesh_(&mesh) {}
  const Hash128& shape();                    ///< all but UVs and colours
  const Hash128& uvs(std::uint32_t uv_set);  ///< of that set; nothing's, if there is none
  const Hash128& colours();                  ///< of its vertices

 private:
  const mesh::Mesh* mesh_;
  std::optional<Hash128> shape_, colours_;
  std::map<std::uint32_t, Hash128> uvs_;
};

/// What was counted of a request, shared by its copies. Not thread-safe.
struct CountedBands {
  std::shared_ptr<const mesh::BlockBands> bands;
};

/// What becomes one geometry store: all pages of a source as one pass sees it, or one page of a
/// target.
struct GeometryRequest {
  const mesh::Mesh* mesh = nullptr;
  std::shared_ptr<MeshHashes> hashes;  ///< of that mesh
  std::vector<mesh::Lattice> pages;
  std::shared_ptr<const mesh::PageTriangles> triangles;
  std::uint32_t first_page = 0;  ///< of `triangles`: what pages[0] stands for
  bool is_target = false;
  bool exact = false;    ///< the mesh's own triangles, however dense: no records, nothing coarsened
  bool colours = false;  ///< of a source, exact: with those of its vertices
  std::optional<mesh::UvTile> tile;  ///< see mesh::BinRequest
  /// Filled when the first stage asks; the mesh may not change.
  std::shared_ptr<CountedBands> counted = std::make_shared<CountedBands>();
};

/// Key of a geometry store: content of the mesh, pages, their triangles, side.
Hash128 geometry_key(const GeometryRequest& request);
/// Preconditions a source or vectorizes a target into a store, or finds it in the cache.
std::unique_ptr<store::GeometryStore> geometry_store(job::JobContext& job,
                                                     const GeometryRequest& request, bool* cached);
/// The least that the work above may need at once, from bin counts.
std::uint64_t geometry_least_bytes(const GeometryRequest& request, std::uint64_t tile_cap_bytes);
/// What the largest block of a source has, at most.
struct SourceShape {
  std::uint32_t most_triangles = 0, most_patches = 0;
};
SourceShape source_shape(const GeometryRequest& request);
/// What stays in memory while such a store is open, at most.
std::uint64_t geometry_directory_bytes(const GeometryRequest& request,
                                       std::uint64_t tile_cap_bytes);
/// What a geometry store holds, before compression.
struct GeometrySize {
  std::uint64_t bytes = 0;
  std::uint64_t chunks = 0;
  std::uint64_t entries = 0;  ///< triangles, in each block again
};
/// The most that such a store holds.
GeometrySize geometry_most(const GeometryRequest& request);

/// One source image as a column of the source store.
struct ColourRequest {
  const mesh::ImageRef* image = nullptr;
  const io::ImageInfo* info = nullptr;  ///< of that image
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
  std::shared_ptr<const mesh::TileMask> wanted;  ///< the tiles that are kept; null: all
  std::span<const ImageFormat> allowed_formats;
};
/// Key of a whole column: content of the image, wrap modes. Reads the image where nobody remembers
/// its content.
Hash128 colour_key(job::JobContext& job, const ColourRequest& request);
/// Key of a column that has only these tiles of the whole one.
Hash128 some_tiles_key(const Hash128& whole, const mesh::TileMask& wanted);

struct FoundColumn {
  std::unique_ptr<store::ColourStore> store;
  bool cached = false;  ///< it was there already
};
/// Builds columns, side by side as memory allows, or finds them in the cache; `keys` are theirs.
/// Advances the meter by their rows of tiles. Counts images in the report.
std::vector<FoundColumn> colour_stores(job::JobContext& job,
                                       std::span<const ColourRequest> requests,
                                       std::span<const Hash128> keys);
/// The same of one column, all of it, under the caller's lease of colour_least_bytes().
FoundColumn whole_colours(job::JobContext& job, const ColourRequest& request, const Hash128& key);
/// What building a column of such an image needs at once, at least.
std::uint64_t colour_least_bytes(const ColourRequest& request);
std::uint64_t colour_least_bytes(std::uint32_t width, std::uint64_t texel_bytes,
                                 std::uint64_t decoder_bytes);

}  // namespace pounce::flow
