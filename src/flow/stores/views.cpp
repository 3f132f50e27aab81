// SPDX-License-Identifier: Apache-2.0
//
// A scene's views become a column of tiles, row by row: a row is a task. It asks the splat store
// for the blocks that each of its tiles may see, one tile after the other; decoded blocks stay in
// the block cache for the next ones. Nothing of the scene is spilled, and nothing is held but a
// tile, the nearest of its Gaussians, a block and the list of those that it may see.
#include "flow/stores/views.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <vector>

#include "planning/load_mesh.h"
#include "runtime/pump.h"
#include "views/target_depth.h"

namespace pounce::flow {
namespace {

/// Of views as they are drawn: what is drawn otherwise is another store.
constexpr std::uint32_t kViewsVersion = 2;

constexpr std::size_t kLeastEllipses = 1 << 10, kMostEllipses = 1 << 19, kTileShare = 16;

/// A row of a view's tiles, compressed; an empty one shows nothing.
using Row = std::vector<std::vector<std::byte>>;

/// Raw, filtered, compressed at its worst, each a little more.
constexpr std::uint64_t encoding_bytes(std::uint32_t samples) {
  return 4 * views::tile_bytes(samples);
}

void encode(job::JobContext& job, const store::ColourDirectory& image,
            std::span<const std::byte> tile, std::vector<std::byte>& stored) {
  std::vector<std::byte> raw;
  store::filter_colours(image, tile, raw);
  job.compressor().compress(raw, stored, store::kScratchLevel);
  stored.shrink_to_fit();
}

std::unique_ptr<ColourCache> opened(job::JobContext& job,
                                    std::unique_ptr<store::ColourStore> store) {
  return std::make_unique<ColourCache>(job.budget, ColourReader{&job, std::move(store), nullptr});
}

using SplatIndexPart = std::shared_ptr<const SplatCache::Index>;

/// Of the list of blocks that a tile may see, if it sees all, and of their entries.
constexpr std::uint64_t places_bytes(std::uint64_t blocks) {
  return blocks * (2 * sizeof(views::NearBlock) + sizeof(store::SplatEntry)) + 4096;
}

class SceneDrawing {
 public:
  SceneDrawing(job::JobContext& job, const ViewsRequest& request, const views::Grid& grid)
      : job_(job),
        request_(request),
        grid_(grid),
        image_(grid.image(views::kSceneSamples)),
        // All degrees, whatever the ray makes of them.
        blocks_(job.budget, SplatReader{{&job, request.scene}, SphericalHarmonics::normal}) {}

  std::unique_ptr<ColourCache> make(bool* cached) {
    const Hash128 key = this->key();
    auto store =
        find_store(job_, store::PackKind::colour, key,
                   [&](std::unique_ptr<store::PackReader> pack) { return open(std::move(pack)); });
    *cached = store != nullptr;
    if (!*cached) store = open(draw(key));
    return opened(job_, std::move(store));
  }

 private:
  std::unique_ptr<store::ColourStore> open(std::unique_ptr<store::PackReader> pack) const {
    return std::make_unique<store::ColourStore>(std::move(pack), image_, job_.compressor(), true);
  }

  Hash128 key() const {
    Hasher hash;
    hash.add(std::string_view("views"));
    hash.add(store::kFormatVersion);
    hash.add(kViewsVersion);
    hash.add(request_.scene->pack().key());
    hash.add(request_.drawing.harmonics);
    grid_.add_to(hash);
    return hash.digest();
  }

  std::uint64_t block_bytes() const {
    const store::SplatDirectory& d = request_.scene->directory();
    return d.largest_chunk_bytes +
           store::SplatBlock::decoded_bytes(d.most_splats, d.has_normals, d.lobes) +
           gaussian::SplatSet::most_bytes(d.most_splats, d.lobes);
  }
  std::uint64_t row_bytes(std::size_t ellipses) const {
    return sizeof(views::Canvas) + views::Slab::most_bytes(ellipses) + block_bytes() +
           places_bytes(request_.scene->directory().blocks()) +
           encoding_bytes(views::kSceneSamples) +
           grid_.tiles_across() * views::tile_bytes(views::kSceneSamples);
  }

  std::unique_ptr<store::PackReader> draw(const Hash128& key) {
    const std::uint64_t room =
        (job_.budget.limit() - std::min(job_.budget.limit(), job_.budget.leased())) /
        (2 * runtime::works_at_once());
    // A tile shows a small part of its scene; what is not leased keeps decoded blocks.
    const std::uint64_t enough =
        std::min<std::uint64_t>(request_.scene->directory().splats / kTileShare, kMostEllipses);
    std::size_t ellipses = kLeastEllipses;
    while (ellipses < enough && row_bytes(2 * ellipses) <= room) ellipses *= 2;
    if (request_.most_ellipses > 0) ellipses = request_.most_ellipses;
    const std::vector<std::uint64_t> costs(image_.tiles_y(), row_bytes(ellipses));
    store::ColourStoreWriter writer(
        job_.stores->create(
            store::PackKind::colour, key,
            fmt::format("{} from {} sides",
                        std::filesystem::path(request_.path).filename().string(), grid_.views())),
        image_.tiles_y());
    runtime::run_ordered<Row>(
        job_.budget, costs, "drawing " + request_.path + " from all around",
        [&](std::size_t row) { return draw_row(static_cast<std::uint32_t>(row), ellipses); },
        [&](std::size_t row, Row& made) {
          writer.add_row(static_cast<std::uint32_t>(row), made,
                         static_cast<std::uint32_t>(views::tile_bytes(views::kSceneSamples)),
                         job_.compressor());
          job_.meter.advance(1);
        });
    return job_.stores->publish(writer.finish(image_, job_.compressor()));
  }

  Row draw_row(std::uint32_t row, std::size_t ellipses) const {
    const std::uint32_t view = row / grid_.tiles_across(), y = row % grid_.tiles_across();
    Row tiles(grid_.tiles_across());
    views::Slab slab(ellipses);
    const auto canvas = std::make_unique<views::Canvas>();
    std::vector<SplatIndexPart> indices;
    for (std::uint32_t x = 0; x < tiles.size(); ++x) {
      job_.meter.throw_if_cancelled();
      if (!grid_.has(view, x, y)) continue;
      const views::TileSight sight(grid_, view, x, y, request_.drawing, *request_.kernels);
      const auto block = [&](const views::NearBlock& near) {
        return blocks_.block(*static_cast<const store::SplatEntry*>(near.entry));
      };
      if (!views::draw_tile(sight, near_blocks(sight, indices), block, *request_.kernels, slab,
                            *canvas))
        continue;
      encode(job_, image_, views::samples_of(*canvas), tiles[x]);
    }
    return tiles;
  }

  /// Those that a tile may see. Their entries lie in `indices`.
  std::vector<views::NearBlock> near_blocks(const views::TileSight& sight,
                                            std::vector<SplatIndexPart>& indices) const {
    std::vector<views::NearBlock> found;
    indices.clear();
    const auto& tiles = request_.scene->directory().tiles;
    for (std::uint32_t t = 0; t < tiles.size(); ++t) {
      if (!sight.meets(tiles[t].box)) continue;
      const auto& entries = *indices.emplace_back(blocks_.index(t));
      for (const store::SplatEntry& entry : entries) {
        // Chunks lie in the order of the store, farther apart than a block has Gaussians.
        if (sight.meets(entry.box))
          found.push_back(
              {sight.depths(entry.box), entry.chunk.offset * store::kMostSplatsPerBlock, &entry});
      }
    }
    return found;
  }

  job::JobContext& job_;
  const ViewsRequest& request_;
  const views::Grid& grid_;
  const store::ColourDirectory image_;
  const SplatCache blocks_;
};

/// Nobody looks for it by its key: it is as quickly drawn as it is read.
std::unique_ptr<ColourCache> draw_targets(job::JobContext& job, const views::Grid& grid,
                                          const mesh::Mesh& target) {
  const store::ColourDirectory image = grid.image(views::kTargetSamples);
  const std::uint32_t across = grid.tiles_across();
  const auto bytes = [&](std::uint32_t rows) {
    return views::TargetDepths::bytes(grid, rows) + encoding_bytes(views::kTargetSamples) +
           std::uint64_t{rows} * across * views::tile_bytes(views::kTargetSamples);
  };
  // All rows of a view at once if there is room: each band goes through all triangles.
  const std::uint64_t room =
      (job.budget.limit() - std::min(job.budget.limit(), job.budget.leased())) /
      (2 * std::uint64_t{job.threads});
  std::uint32_t band = across;
  while (band > 1 && bytes(band) > room) band = (band + 1) / 2;
  const std::uint32_t bands = (across + band - 1) / band;
  const std::vector<std::uint64_t> costs(std::size_t{grid.views()} * bands, bytes(band));
  store::ColourStoreWriter writer(job.scratch->create(store::PackKind::colour, {}),
                                  image.tiles_y());
  runtime::run_ordered<std::vector<Row>>(
      job.budget, costs, "drawing the target from all around",
      [&](std::size_t i) {
        job.meter.throw_if_cancelled();
        const auto view = static_cast<std::uint32_t>(i / bands),
                   first = static_cast<std::uint32_t>(i % bands) * band;
        const auto drawn =
            views::draw_target(target, grid, view, first, std::min(band, across - first));
        std::vector<Row> rows(drawn.tile_rows, Row(across));
        for (std::uint32_t y = 0; y < drawn.tile_rows; ++y) {
          for (std::uint32_t x = 0; x < across; ++x) {
            if (drawn.has(x, first + y)) encode(job, image, drawn.tile(x, first + y), rows[y][x]);
          }
        }
        return rows;
      },
      [&](std::size_t i, std::vector<Row>& rows) {
        const auto view = static_cast<std::uint32_t>(i / bands),
                   first = static_cast<std::uint32_t>(i % bands) * band;
        for (std::uint32_t y = 0; y < rows.size(); ++y)
          writer.add_row(grid.tile_row(view, first + y), rows[y],
                         static_cast<std::uint32_t>(views::tile_bytes(views::kTargetSamples)),
                         job.compressor());
      });
  return opened(job, std::make_unique<store::ColourStore>(
                         publish_scratch(job, writer.finish(image, job.compressor())), image,
                         job.compressor(), true));
}

}  // namespace

SceneViews scene_views(job::JobContext& job, const ViewsRequest& request, const mesh::Mesh& target,
                       double diagonal, float edge, double progress_end) {
  SceneViews out{views::Grid(planning::box_of(target), edge, request.views),
                 {},
                 request.kernels,
                 nullptr,
                 nullptr};
  out.limits.on_target = out.grid.in_steps(static_cast<float>(views::kOnTarget * diagonal));
  out.limits.hidden = out.grid.in_steps(static_cast<float>(views::kHidden * diagonal));
  job.meter.begin("views", out.grid.image(views::kSceneSamples).tiles_y(), "rows", progress_end);
  bool cached = false;
  out.scene = SceneDrawing(job, request, out.grid).make(&cached);
  job.count_store(out.scene->store().pack(), cached);
  job.report.source_store_bytes += out.scene->store().pack().size_bytes();
  if (cached) job.clock.set_cached("views");
  job.report.views = out.grid.views();
  out.target_goes = std::make_unique<job::ScratchPack>(job, store::PackKind::colour);
  out.target = draw_targets(job, out.grid, target);
  job.meter.end(cached);
  return out;
}

std::uint64_t scene_views_least_bytes(std::uint32_t lobes, std::uint64_t splats) {
  constexpr std::uint64_t kSplats = store::kMostSplatsPerBlock;
  constexpr std::uint64_t kFewInBlock = kSplats / 4;  // blocks are cut where neighbours part
  return sizeof(views::Canvas) + views::Slab::most_bytes(kLeastEllipses) +
         kSplats * (sizeof(store::Splat) + store::lobe_bytes(lobes)) +
         store::SplatBlock::decoded_bytes(kSplats, true, lobes) +
         gaussian::SplatSet::most_bytes(kSplats, lobes) + places_bytes(splats / kFewInBlock) +
         encoding_bytes(views::kSceneSamples) +
         views::Grid::kMostAcross * views::tile_bytes(views::kSceneSamples);
}

}  // namespace pounce::flow
