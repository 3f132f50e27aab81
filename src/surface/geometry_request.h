// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/hash.h"
#include "mesh/block_bins.h"
#include "mesh/mesh.h"
#include "store/blocks/geometry_store.h"

namespace pounce::surface {

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

  /// Are blocks with tiny triangles said in fewer? Those of a source, unless it is wanted exactly.
  bool coarsens_dense() const { return !is_target && !exact; }
};

/// Key of a geometry store: content of the mesh, pages, their triangles, side.
Hash128 geometry_key(const GeometryRequest& request);
/// "scan.glb as a source, 10092 triangles, 2048 x 2048": what `pounce cache list` shows.
std::string geometry_label(const GeometryRequest& request);
/// Cuts its triangles into bins. Its bands are counted once, whoever asks first.
mesh::BlockBinner binner_of(const GeometryRequest& request, std::uint64_t tile_cap_bytes);
/// What its store must agree with. `entries`: of blocks and triangles; no block is without one.
store::GeometryFacts facts_of(const GeometryRequest& request, std::uint64_t entries);

/// What making the blocks of a tile may need.
std::uint64_t tile_cost(const GeometryRequest& request, const mesh::BlockBins& bins,
                        const mesh::TileRange& tile);
/// The least that making its blocks may need at once, from bin counts.
std::uint64_t geometry_least_bytes(const GeometryRequest& request, std::uint64_t tile_cap_bytes);
/// Triangles of the largest block of a source, at most; it has no more patches.
std::uint32_t most_in_source_block(const GeometryRequest& request);
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

}  // namespace pounce::surface
