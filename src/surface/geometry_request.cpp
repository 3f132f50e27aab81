// SPDX-License-Identifier: Apache-2.0
//
// What becomes one geometry store: its key, and what making and holding it costs.
//
// Costs are bounds from above that are known before any block is made, since a job that does not
// fit its budget is to say so at once. They follow from counting into which windows of 64x64 texels
// triangles fall, which is cheap, and from the most that a triangle or a block can take.
//
// The key holds all that the blocks depend on: positions, normals and tangents, colours where they
// are stored, UVs, which triangles are on which page, each lattice, and the version of the rules.
// What is missing in a key gives stale blocks from the cache, which nothing later is sure to
// notice.
#include "surface/geometry_request.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <span>

#include "surface/coarsen.h"
#include "surface/source_block.h"

namespace pounce::surface {
namespace {

/// Bytes that a tile may need while it is made: its largest block decoded twice over and coarsened,
/// and all of it encoded. `largest`, `all`: triangles.
std::uint64_t tile_bytes(const GeometryRequest& request, std::uint64_t largest, std::uint64_t all,
                         std::uint64_t blocks) {
  constexpr std::uint64_t kPerTriangle = 1000, kStoredPerTriangle = 80, kPerBlock = 12 << 10,
                          kFixed = 256 << 10;
  // Three colours: as built, encoded twice over, and as stored.
  constexpr std::uint64_t kColours = 3 * sizeof(Vec4f);
  const std::uint64_t in_block = std::min<std::uint64_t>(largest, store::kMostTrianglesPerBlock);
  const std::uint64_t colours = request.colours ? kColours * (4 * in_block + all) : 0;
  const bool coarsens = request.coarsens_dense() && is_dense(largest);
  return kFixed + kPerTriangle * in_block + colours + (coarsens ? coarsen_bytes(largest) : 0) +
         kStoredPerTriangle * all + kPerBlock * blocks;
}

mesh::BinRequest bin_request(const GeometryRequest& request, std::uint64_t tile_cap_bytes) {
  return {request.mesh,      request.pages, request.triangles.get(), request.first_page,
          request.is_target, request.tile,  tile_cap_bytes,          request.coarsens_dense()};
}

template <class Values>
void add(const Values& values, Hasher& hash) {
  hash.add(static_cast<std::uint64_t>(values.size()));
  hash.add(std::as_bytes(std::span(values)));
}

}  // namespace

const Hash128& MeshHashes::shape() {
  if (shape_) return *shape_;
  // Hashed once: the passes and pages of a job share these arrays, of which each has its own key.
  Hasher hash;
  add(mesh_->positions, hash);
  add(mesh_->normals, hash);
  add(mesh_->tangents, hash);
  add(mesh_->triangles, hash);
  return shape_.emplace(hash.digest());
}

const Hash128& MeshHashes::colours() {
  if (colours_) return *colours_;
  Hasher hash;
  add(mesh_->colours, hash);
  return colours_.emplace(hash.digest());
}

const Hash128& MeshHashes::uvs(std::uint32_t uv_set) {
  const auto [at, fresh] = uvs_.try_emplace(uv_set);
  if (fresh) {
    Hasher hash;
    if (uv_set < mesh_->uv_sets.size()) add(mesh_->uv_sets[uv_set], hash);
    at->second = hash.digest();
  }
  return at->second;
}

std::string geometry_label(const GeometryRequest& request) {
  const std::string name = std::filesystem::path(request.mesh->path).filename().string();
  std::string label =
      fmt::format("{} as a {}, {} triangles", name, request.is_target ? "target" : "source",
                  request.mesh->triangles.size());
  if (request.tile) {
    label += fmt::format(", UDIM {}", mesh::udim_number(*request.tile).value_or(0));
  }
  if (request.pages.size() == 1) {
    label += fmt::format(", {} x {}", request.pages[0].width, request.pages[0].height);
  } else {
    label += fmt::format(", {} pages", request.pages.size());
  }
  return label;
}

mesh::BlockBinner binner_of(const GeometryRequest& request, std::uint64_t tile_cap_bytes) {
  const mesh::BinRequest bins = bin_request(request, tile_cap_bytes);
  std::shared_ptr<const mesh::BlockBands>& bands = request.counted->bands;
  if (bands == nullptr) bands = std::make_shared<const mesh::BlockBands>(mesh::count_bands(bins));
  return {bins, bands};
}

store::GeometryFacts facts_of(const GeometryRequest& request, std::uint64_t entries) {
  return {request.is_target, request.pages, request.mesh->triangles.size(), entries,
          request.colours};
}

std::uint64_t tile_cost(const GeometryRequest& request, const mesh::BlockBins& bins,
                        const mesh::TileRange& tile) {
  std::uint64_t largest = 0, all = 0;
  for (std::uint32_t b = tile.first_block; b < tile.first_block + tile.block_count; ++b) {
    largest = std::max<std::uint64_t>(largest, bins.blocks[b].count);
    all += bins.blocks[b].count;
  }
  return tile_bytes(request, largest, all, tile.block_count);
}

Hash128 geometry_key(const GeometryRequest& request) {
  Hasher hash;
  // The numbers are of the rules that cut triangles and pages: others make other blocks.
  hash.add(std::string_view(request.is_target ? "target geometry 2" : "source geometry 6"));
  hash.add(std::uint32_t{request.exact ? 1U : 0U});
  hash.add(store::kFormatVersion);
  hash.add(request.hashes->shape());
  if (request.colours) hash.add(request.hashes->colours());
  hash.add(static_cast<std::uint64_t>(request.pages.size()));
  for (std::size_t p = 0; p < request.pages.size(); ++p) {
    const mesh::Lattice& page = request.pages[p];
    hash.add(page.width);
    hash.add(page.height);
    hash.add(page.uv_set);
    const mesh::UvTransform& t = page.transform;
    for (const double v : {t.a, t.b, t.c, t.d, t.e, t.f}) hash.add(v);
    // A page without an image does not use its UVs.
    if (page.width != 0) hash.add(request.hashes->uvs(page.uv_set));
    add(request.triangles->of(request.first_page + p), hash);
  }
  // Coincident triangles are told apart by all of their UVs.
  for (std::uint32_t k = 0; !request.is_target && k < request.mesh->uv_sets.size(); ++k)
    hash.add(request.hashes->uvs(k));
  hash.add(std::uint32_t{request.tile ? 1U : 0U});
  if (request.tile) {
    hash.add(request.tile->column);
    hash.add(request.tile->row);
  }
  return hash.digest();
}

std::uint64_t geometry_least_bytes(const GeometryRequest& request, std::uint64_t tile_cap_bytes) {
  // This decides whether a job is refused, before any bin exists. It must not be below what
  // tile_cost() asks for later, or a job that was admitted could not go on.
  const mesh::BlockBinner binner = binner_of(request, tile_cap_bytes);
  const std::uint64_t bins = binner.cost_bytes(binner.most_entries());
  // A tile has no more triangles than its cap has room for, and one window; nor more than all of
  // them, four times each.
  const std::uint64_t in_cap = tile_cap_bytes / mesh::kTileBytesPerTriangle;
  const std::uint64_t all = std::min(binner.entries(), in_cap + binner.most_in_block());
  const std::uint64_t triangles = request.mesh->triangles.size();
  const std::uint64_t largest = std::min(triangles, binner.most_in_block());
  return bins +
         tile_bytes(request, largest, std::min(all, 4 * triangles), mesh::kMostBlocksPerTile);
}

std::uint64_t geometry_directory_bytes(const GeometryRequest& request,
                                       std::uint64_t tile_cap_bytes) {
  const std::uint64_t entries = binner_of(request, tile_cap_bytes).entries();
  // The k-d split leaves tiles half full, of bytes or of blocks; each page and band begins one.
  const std::uint64_t weight = (256 + mesh::kTileBytesPerTriangle) * entries;
  const std::uint64_t tiles =
      std::min(entries, 4 * weight / std::max<std::uint64_t>(tile_cap_bytes, 1) +
                            4 * entries / mesh::kMostBlocksPerTile + 2 * request.pages.size() + 8);
  return 2 * tiles * sizeof(store::TileEntry) + 4 * request.pages.size() * sizeof(mesh::Lattice);
}

std::uint32_t most_in_source_block(const GeometryRequest& request) {
  const std::uint64_t triangles = request.mesh->triangles.size();
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(triangles, store::kMostTrianglesPerBlock));
}

// Bounds for the disk check before work begins, so every block is assumed to be stored as
// triangles, without any compression.
GeometrySize geometry_most(const GeometryRequest& request) {
  // Three vertices that it shares with none.
  const std::uint64_t per_triangle = 138 + (request.colours ? 3 * sizeof(Vec4f) : 0);
  constexpr std::uint64_t kPerBlock = 320;  // header, place and boxes
  constexpr std::uint64_t kPerRun = 4;      // of texels with one owner
  constexpr std::uint64_t kEdge = mesh::kBlockEdge;
  const std::uint64_t entries = binner_of(request, mesh::kTileCapBytes).entries();
  // Each block has a triangle, and the blocks of a target lie in its images.
  std::uint64_t blocks = entries, runs = 0;
  if (request.is_target) {
    std::uint64_t in_images = 0;
    for (const mesh::Lattice& page : request.pages)
      in_images += ((page.width + kEdge - 1) / kEdge) * ((page.height + kEdge - 1) / kEdge);
    blocks = std::min(entries, in_images);
    // A triangle adds two ends of runs to a row of a block at most.
    runs = std::min(blocks * store::kTexelsPerBlock, kEdge * blocks + 2 * kEdge * entries);
  }
  const std::uint64_t pages = request.pages.size() * (sizeof(mesh::Lattice) + 16);
  return {entries * per_triangle + blocks * kPerBlock + runs * kPerRun + pages, 2 * blocks,
          entries};
}

}  // namespace pounce::surface
