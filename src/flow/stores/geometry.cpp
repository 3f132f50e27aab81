// SPDX-License-Identifier: Apache-2.0
//
// Precondition and vectorize: one mesh becomes a store of blocks.
//
// Triangles are binned by the 64x64 windows that they touch, windows grouped into tiles, and each
// tile made, compressed and written on its own: in parallel, in order, under the budget.
//
// Bins of a whole mesh would need memory in proportion to all (block, triangle) pairs. So triangles
// are binned in bands of rows of blocks, one band after the other
// (docs/decisions/019-page-by-page.md). What a band is depends on the triangles alone, hence the
// same pack at any budget.
//
// Where the cache has the pack, nothing is binned or built. Triangles are only counted, since the
// pack is held against that count.
#include <utility>

#include "flow/stores/build_stores.h"
#include "flow/stores/find_store.h"
#include "runtime/ordered_stream.h"
#include "surface/block_maker.h"

namespace pounce::flow {
namespace {

/// Makes the tiles of one band, in order, and adds them up in `directory`.
void build_band(job::JobContext& job, const surface::GeometryRequest& request,
                const mesh::BlockBins& bins, store::GeometryStoreWriter& writer,
                store::GeometryDirectory& directory) {
  std::vector<std::uint64_t> costs;
  for (const mesh::TileRange& tile : bins.tiles)
    costs.push_back(surface::tile_cost(request, bins, tile));
  runtime::run_ordered<surface::EncodedTile>(
      job.budget, costs,
      request.is_target ? "vectorizing the target" : "preconditioning the source",
      [&](std::size_t i) {
        return surface::make_tile(request, bins, bins.tiles[i], job.compressor(),
                                  [&] { job.meter.advance(0); });
      },
      [&](std::size_t, surface::EncodedTile& tile) {
        for (surface::EncodedBlock& block : tile.blocks)
          writer.add_block(block.entry, block.stored, block.raw_bytes);
        // In order and one at a time, so counts need no lock and the pack has one sequence.
        writer.end_tile(job.compressor());
        directory.texels += tile.texels;
        directory.page_texels[tile.page] += tile.texels;
        directory.overlapping += tile.overlapping;
        directory.slivers += tile.slivers;
        directory.degenerate += tile.degenerate;
        ++job.report.tiles_written;
        job.meter.advance(1);
      });
}

std::unique_ptr<store::GeometryStore> build(job::JobContext& job,
                                            const surface::GeometryRequest& request,
                                            const Hash128& key) {
  const mesh::BlockBinner binner = surface::binner_of(request, job.tile_cap_bytes);
  store::GeometryStoreWriter writer(
      job.stores->create(store::PackKind::geometry, key, surface::geometry_label(request)));
  store::GeometryDirectory directory;
  directory.pages = request.pages;
  directory.page_texels.assign(request.pages.size(), 0);
  // Counted once, with the store: jobs that find it in the cache need not count again.
  if (request.coarsens_dense()) directory.coincident = mesh::count_coincident(*request.mesh);
  for (std::size_t band = 0; band < binner.bands(); ++band) {
    const runtime::Lease lease(job.budget, binner.cost_bytes(binner.entries(band)),
                               "binning the triangles of " + request.mesh->path);
    build_band(job, request, binner.bin(band), writer, directory);
  }
  return std::make_unique<store::GeometryStore>(
      job.stores->publish(writer.finish(directory, job.compressor())),
      surface::facts_of(request, binner.entries()), job.compressor());
}

}  // namespace

std::unique_ptr<store::GeometryStore> geometry_store(job::JobContext& job,
                                                     const surface::GeometryRequest& request,
                                                     bool* cached) {
  const Hash128 key = surface::geometry_key(request);
  auto store =
      find_store(job, store::PackKind::geometry, key, [&](std::unique_ptr<store::PackReader> pack) {
        const std::uint64_t entries = surface::binner_of(request, mesh::kTileCapBytes).entries();
        return std::make_unique<store::GeometryStore>(
            std::move(pack), surface::facts_of(request, entries), job.compressor());
      });
  *cached = store != nullptr;
  return *cached ? std::move(store) : build(job, request, key);
}

}  // namespace pounce::flow
