// SPDX-License-Identifier: Apache-2.0
//
// Packs of the cache, opened and held against what the job knows.
//
// A checksum says that bytes are those that somebody wrote, not that pounce wrote them. Opening a
// store checks its directory; a job that found damage, or may not be run twice, has every block
// checked.
//
// What is found to be damaged is thrown as Error(damaged_store). While a store is opened that costs
// one rebuild of it (find_store()), later the whole job begins again, once, and checks all packs
// first (job/run_job.cpp). So checking everything always would protect little and cost a reading of
// every block.
#include "flow/stores/build_stores.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "core/hash.h"
#include "core/page_pool.h"
#include "io/image/read.h"
#include "mesh/lattice.h"
#include "projection/hit_block.h"
#include "runtime/pump.h"
#include "store/pack/pack_layout.h"
#include "surface/block_maker.h"

namespace pounce::flow {
namespace {

/// A target's block stands in its image once, and images follow each other.
void check_places(const store::GeometryStore& store,
                  std::vector<std::tuple<std::uint32_t, std::int32_t, std::int32_t>> places) {
  const auto page = [](const auto& a, const auto& b) { return std::get<0>(a) < std::get<0>(b); };
  if (!std::is_sorted(places.begin(), places.end(), page))
    store.damaged("its pages are out of order");
  std::sort(places.begin(), places.end());
  if (std::adjacent_find(places.begin(), places.end()) != places.end())
    store.damaged("duplicate block");
}

}  // namespace

void check_store(job::JobContext& job, const store::GeometryStore& store) {
  std::vector<std::tuple<std::uint32_t, std::int32_t, std::int32_t>> places;
  for (std::uint32_t tile = 0; tile < store.directory().tiles.size(); ++tile) {
    for (const store::BlockEntry& entry : store.read_index(tile, job.compressor())) {
      const store::GeometryBlock block = store.read_block(entry, job.compressor());
      if (store.facts().is_target) {
        places.emplace_back(entry.page, entry.y, entry.x);
      } else {
        decoded_source(store, entry, block);
      }
    }
    job.meter.advance(0);  // stops here if the caller asked to
  }
  check_places(store, std::move(places));
}

void check_store(job::JobContext& job, const store::ColourStore& store) {
  for (std::uint32_t row = 0; row < store.directory().tiles_y(); ++row) {
    for (const store::ChunkRef& chunk : store.read_row(row, job.compressor())) {
      const bool is_there = !store.leaves_out() || !store::is_left_out(chunk);
      if (is_there) (void)store.read_tile(chunk, job.compressor());
    }
    job.meter.advance(0);
  }
}

void check_store(job::JobContext& job, const store::SplatStore& store) {
  for (std::uint32_t tile = 0; tile < store.directory().tiles.size(); ++tile) {
    for (const store::SplatEntry& entry : store.read_index(tile, job.compressor()))
      (void)store.read_block(entry, job.compressor());
    job.meter.advance(0);
  }
}

void check_largest(job::JobContext& job, const store::GeometryStore& store) {
  const store::GeometryDirectory& says = store.directory();
  // Entries may claim what they like as well. A block that would set a new maximum is decoded,
  // which refuses a false claim; all others cannot make the maxima larger.
  std::uint32_t triangles = 0, patches = 0, chunk_bytes = 0;
  for (std::uint32_t tile = 0; tile < says.tiles.size(); ++tile) {
    for (const store::BlockEntry& entry : store.read_index(tile, job.compressor())) {
      const bool is_larger = entry.triangles > triangles || entry.patches > patches ||
                             entry.chunk.raw_bytes > chunk_bytes;
      if (!is_larger) continue;
      decoded_source(store, entry, store.read_block(entry, job.compressor()));
      triangles = std::max(triangles, entry.triangles);
      patches = std::max(patches, entry.patches);
      chunk_bytes = std::max(chunk_bytes, entry.chunk.raw_bytes);
    }
    job.meter.advance(0);  // stops here if the caller asked to
  }
  if (triangles != says.most_triangles || patches != says.most_patches ||
      chunk_bytes != says.largest_chunk_bytes) {
    store.damaged("its blocks are smaller than it states");
  }
}

surface::SourceBlock decoded_source(const store::GeometryStore& store,
                                    const store::BlockEntry& entry,
                                    const store::GeometryBlock& block, bool with_attributes) {
  surface::SourceBlock made =
      surface::make_source_block(block, store.directory().pages[entry.page], with_attributes);
  if (made.patches.size() != entry.patches)
    store.damaged("a block decodes to a different number of patches than its index states");
  return made;
}

// --- of meshes -----------------------------------------------------------------------------------
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

namespace {

const char* stage_of(const surface::GeometryRequest& request) {
  return request.is_target ? "vectorize" : "precondition";
}

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
        const WorkTimer timer(job.clock, stage_of(request));
        return surface::make_tile(request, bins, bins.tiles[i], job.compressor(), job.stores_room(),
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
      });
}

std::unique_ptr<store::GeometryStore> build(job::JobContext& job,
                                            const surface::GeometryRequest& request,
                                            const Hash128& key) {
  const WorkTimer timer(job.clock, stage_of(request));  // it may run beside another stage
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

// --- of hit maps ---------------------------------------------------------------------------------
//
// A map is rows of texels, shading wants blocks: 64 rows at a time are read, cut into blocks side
// by side, and stored. Reading is what takes time, since a decoder gives one row after the other;
// the next job on the same map finds the store in the cache.

namespace {

using mesh::kBlockEdge;

/// Of the rules that a map's hits follow: others are other hits.
constexpr std::string_view kRules = "hits of a map 1";

Hash128 key_of(job::JobContext& job, const MapRequest& request) {
  const Hash128 content = job::file_hash(job, request.path);
  Hasher hash;
  hash.add(kRules);
  hash.add(store::kFormatVersion);
  hash.add(content);
  hash.add(std::uint64_t{request.source_pages});
  hash.add(request.max_distance);
  return hash.digest();
}

std::uint64_t band_bytes(ImageSize size) {
  return std::uint64_t{kBlockEdge} * size.width * sizeof(projection::HitMapTexel);
}

struct StoredBlock {
  std::vector<std::byte> stored;  ///< empty: nothing was hit
  std::uint32_t raw_bytes = 0;
};

class MapConversion {
 public:
  MapConversion(job::JobContext& job, const MapRequest& request)
      : job_(job),
        request_(request),
        lease_(job.budget, map_hits_bytes(request), "reading " + request.path),
        reader_(request.path, {projection::kHitMapNames.begin(), projection::kHitMapNames.end()},
                request.trust),
        grid_(request.size),
        rows_(band_bytes(request.size)),
        blocks_(grid_.across) {
    const io::ImageInfo& info = reader_.info();
    if (info.width != request.size.width || info.height != request.size.height ||
        info.depth != Depth::float32)
      throw Error(ErrorKind::input, request.path + ": the file changed while it was read");
  }

  std::unique_ptr<store::PackWriter> run(std::unique_ptr<store::PackWriter> pack) {
    store::HitStoreWriter writer(std::move(pack), grid_);
    for (std::uint32_t by = 0; by < grid_.down; ++by) {
      const std::uint32_t first = by * kBlockEdge;
      const std::uint32_t count = std::min<std::uint32_t>(kBlockEdge, request_.size.height - first);
      reader_.read_rows(count, rows_.data());
      tbb::parallel_for(std::uint32_t{0}, grid_.across,
                        [&](std::uint32_t bx) { blocks_[bx] = block(bx, by, count); });
      for (std::uint32_t bx = 0; bx < grid_.across; ++bx) {
        if (!blocks_[bx].stored.empty())
          writer.add(bx, by, blocks_[bx].stored, blocks_[bx].raw_bytes);
      }
      job_.meter.advance(0);  // stops here if the caller asked to
    }
    return writer.finish(job_.compressor());
  }

 private:
  StoredBlock block(std::uint32_t bx, std::uint32_t by, std::uint32_t rows) {
    constexpr std::size_t kValues = std::tuple_size_v<projection::HitMapTexel>;
    const std::uint32_t left = bx * kBlockEdge;
    projection::MapWindow window;
    const std::span texels(reinterpret_cast<const float*>(rows_.data()),
                           rows_.size() / sizeof(float));
    window.texels = texels.subspan(left * kValues);
    window.stride = request_.size.width;
    window.width = std::min<std::uint32_t>(kBlockEdge, request_.size.width - left);
    window.height = rows;
    const projection::HitBlock hits = projection::hits_of_map(
        window, request_.source_pages, request_.max_distance,
        fmt::format("{}: texels from ({}, {}) on", request_.path, left, by * kBlockEdge));
    StoredBlock out;
    if (hits.size() == 0) return out;
    std::vector<std::byte> raw;
    projection::encode(hits, raw);
    out.raw_bytes = static_cast<std::uint32_t>(raw.size());
    job_.compressor().compress(raw, out.stored, store::kFastLevel, job_.stores_room());
    return out;
  }

  job::JobContext& job_;
  const MapRequest& request_;
  runtime::Lease lease_;
  io::ImageReader reader_;
  const store::HitGrid grid_;
  PageVector<std::byte> rows_;
  std::vector<StoredBlock> blocks_;  ///< of one row of them
};

}  // namespace

std::unique_ptr<store::HitStore> map_hits(job::JobContext& job, const MapRequest& request,
                                          bool* cached) {
  const Hash128 key = key_of(job, request);
  const store::HitStore::Facts facts{request.size, request.source_pages, projection::kMostHitBytes};
  auto found =
      find_store(job, store::PackKind::hits, key, [&](std::unique_ptr<store::PackReader> pack) {
        return std::make_unique<store::HitStore>(std::move(pack), facts, job.compressor());
      });
  *cached = found != nullptr;
  if (*cached) return found;
  auto pack = job.stores->create(
      store::PackKind::hits, key,
      fmt::format("hits of a map, {} x {}", request.size.width, request.size.height));
  return std::make_unique<store::HitStore>(
      job.stores->publish(MapConversion(job, request).run(std::move(pack))), facts,
      job.compressor());
}

std::uint64_t map_hits_bytes(const MapRequest& request) {
  const store::HitGrid grid(request.size);
  // A row of blocks as they are read and as they are stored, and what is encoded just now.
  return request.decoder_bytes + 2 * round_to_pages(band_bytes(request.size)) + grid.index_bytes() +
         (4ULL << 20);
}

}  // namespace pounce::flow
