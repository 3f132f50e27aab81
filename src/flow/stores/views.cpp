// SPDX-License-Identifier: Apache-2.0
//
// A scene's views become a column of tiles, row by row: a row is a task. It asks the splat store
// for the blocks that each of its tiles may see, one tile after the other; decoded blocks stay in
// the block cache for the next ones (docs/decisions/074-views-in-small-budgets.md). Nothing of the
// scene is spilled, and nothing is held but a tile, the nearest of its Gaussians, a block and the
// list of those that it may see.
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
constexpr std::uint32_t kViewsVersion = 3;

/// Scratch packs beside that of the target's depths.
constexpr Hash128 kInsideTarget{0, 1}, kInsideScene{0, 2};

constexpr std::size_t kLeastEllipses = 1 << 10, kMostEllipses = 1 << 19;
/// What a tile may well show of its scene, and what few tiles show more than twice of: a slab holds
/// twice its size while ellipses come.
constexpr std::size_t kTileShare = 16, kUsualTileShare = 64;

/// A row of a view's tiles, compressed; an empty one shows nothing.
using Row = std::vector<std::vector<std::byte>>;

/// Raw, filtered, compressed at its worst, each a little more.
constexpr std::uint64_t encoding_bytes(std::uint32_t samples) {
  return 4 * views::tile_bytes(samples);
}

/// `room`: what the forecast of a job's disk does not know of has none.
void encode(job::JobContext& job, const store::ColourDirectory& image,
            std::span<const std::byte> tile, store::PlainRoom* room,
            std::vector<std::byte>& stored) {
  store::encode_tile(image, tile, job.compressor(), store::kFastLevel, room, stored);
  stored.shrink_to_fit();
}

std::unique_ptr<ColourCache> opened(job::JobContext& job,
                                    std::unique_ptr<store::ColourStore> store) {
  // Texels that lie together are seen from everywhere: a piece looks into tiles of all views.
  return std::make_unique<ColourCache>(
      job.budget, ColourReader{&job, std::move(store), nullptr, runtime::Reuse::anywhere});
}

using SplatIndexPart = std::shared_ptr<const DrawnCache::Index>;

/// Of the list of blocks that a tile may see, if it sees all, and of their entries.
constexpr std::uint64_t places_bytes(std::uint64_t blocks) {
  return blocks * (2 * sizeof(views::NearBlock) + sizeof(store::SplatEntry)) + 4096;
}

class SceneDrawing {
 public:
  /// `before_inside`: how far before an inside the scene begins, in steps of depth.
  SceneDrawing(job::JobContext& job, const ViewsRequest& request, const views::Grid& grid,
               float before_inside)
      : job_(job),
        request_(request),
        grid_(grid),
        sharpening_(views::sharpening_of(grid)),
        before_inside_(before_inside),
        image_(grid.image(views::kSceneSamples)),
        blocks_(job.budget, DrawnReader{{&job, request.scene}}) {}

  std::unique_ptr<ColourCache> make(bool* cached) {
    const Hash128 key = this->key();
    auto store =
        find_store(job_, store::PackKind::colour, key,
                   [&](std::unique_ptr<store::PackReader> pack) { return open(std::move(pack)); });
    *cached = store != nullptr;
    if (!*cached) {
      const std::string name = std::filesystem::path(request_.path).filename().string();
      store = open(job_.stores->publish(
          draw(job_.stores->create(store::PackKind::colour, key,
                                   fmt::format("{} from {} sides", name, grid_.views())),
               nullptr)));
    }
    return opened(job_, std::move(store));
  }
  /// Where `depths` has tiles, from a little before these on.
  std::unique_ptr<ColourCache> make_inside(const ColourCache& depths) {
    return opened(
        job_,
        open(publish_scratch(
            job_, draw(job_.scratch->create(store::PackKind::colour, kInsideScene), &depths))));
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
           gaussian::SplatColumns::most_bytes(d.most_splats, d.lobes);
  }
  std::uint64_t row_bytes(std::size_t ellipses, std::uint32_t tiles) const {
    return sizeof(views::Canvas) + sizeof(views::Sharpener) + views::Slab::most_bytes(ellipses) +
           block_bytes() + places_bytes(request_.scene->directory().blocks()) +
           encoding_bytes(views::kSceneSamples) + 3 * views::tile_bytes(views::kTargetSamples) +
           tiles * views::tile_bytes(views::kSceneSamples);
  }
  std::uint32_t tiles_of(std::uint32_t row) const {
    const std::uint32_t view = row / grid_.tiles_across(), y = row % grid_.tiles_across();
    std::uint32_t count = 0;
    for (std::uint32_t x = 0; x < grid_.tiles_across(); ++x) count += grid_.has(view, x, y) ? 1 : 0;
    return count;
  }
  /// All blocks, decoded.
  std::uint64_t scene_bytes() const {
    const store::SplatDirectory& d = request_.scene->directory();
    return d.splats * gaussian::SplatColumns::most_bytes(d.most_splats, d.lobes) /
           std::max(d.most_splats, 1U);
  }

  std::unique_ptr<store::PackWriter> draw(std::unique_ptr<store::PackWriter> pack,
                                          const ColourCache* inside) {
    std::vector<std::uint32_t> tiles(image_.tiles_y());
    for (std::uint32_t row = 0; row < tiles.size(); ++row) tiles[row] = tiles_of(row);
    const std::uint32_t most_tiles = *std::max_element(tiles.begin(), tiles.end());
    const std::uint64_t left =
        job_.budget.limit() - std::min(job_.budget.limit(), job_.budget.leased());
    // A tile shows a small part of its scene; what is not leased keeps decoded blocks. Where not
    // all of them stay, rows that wait for a thread would only take their place.
    const bool has_room = scene_bytes() <= left / 2;
    const std::size_t at_once = runtime::works_at_once(has_room ? 3 : 1);
    const std::uint64_t room =
        left / (has_room ? 2 * at_once : std::max<std::size_t>(2 * at_once, 4));
    const std::uint64_t enough = std::min<std::uint64_t>(
        request_.scene->directory().splats / (has_room ? kTileShare : kUsualTileShare),
        kMostEllipses);
    std::size_t ellipses = kLeastEllipses;
    while (ellipses < enough && row_bytes(2 * ellipses, most_tiles) <= room) ellipses *= 2;
    if (request_.most_ellipses > 0) ellipses = request_.most_ellipses;
    std::vector<std::uint64_t> costs;
    for (const std::uint32_t count : tiles) costs.push_back(row_bytes(ellipses, count));
    store::ColourStoreWriter writer(std::move(pack), image_.tiles_y());
    runtime::run_ordered<Row>(
        job_.budget, costs, "drawing " + request_.path + " from all around",
        [&](std::size_t row) {
          return draw_row(static_cast<std::uint32_t>(row), ellipses, inside);
        },
        [&](std::size_t row, Row& made) {
          writer.add_row(static_cast<std::uint32_t>(row), made,
                         static_cast<std::uint32_t>(views::tile_bytes(views::kSceneSamples)),
                         job_.compressor());
          job_.meter.advance(inside == nullptr ? 1 : 0);
        },
        at_once);
    return writer.finish(image_, job_.compressor());
  }

  Row draw_row(std::uint32_t row, std::size_t ellipses, const ColourCache* inside) const {
    const std::uint32_t view = row / grid_.tiles_across(), y = row % grid_.tiles_across();
    Row tiles(grid_.tiles_across());
    views::Slab slab(ellipses);
    const auto canvas = std::make_unique<views::Canvas>();
    const auto sharpener = std::make_unique<views::Sharpener>(sharpening_, *request_.kernels);
    if (grid_.begins_within()) canvas->begin_at(grid_.begin(view));
    std::vector<SplatIndexPart> indices;
    for (std::uint32_t i = 0; i < tiles.size(); ++i) {
      job_.meter.throw_if_cancelled();
      // There and back: a row begins at the blocks that the one before has left decoded.
      const auto x = y % 2 == 0 ? i : static_cast<std::uint32_t>(tiles.size()) - 1 - i;
      if (!grid_.has(view, x, y)) continue;
      if (inside != nullptr) {
        const store::ChunkRef depths = (*inside->index(row))[x];
        if (store::is_left_out(depths)) continue;
        canvas->begin_before(samples_of(*inside->block(depths)), before_inside_);
      }
      const views::TileSight sight(grid_, view, x, y, request_.drawing, *request_.kernels);
      const auto block = [&](const views::NearBlock& near) {
        return blocks_.block(*static_cast<const store::SplatEntry*>(near.entry));
      };
      if (!views::draw_tile(sight, near_blocks(sight, indices), block, *request_.kernels, slab,
                            *canvas))
        continue;
      encode(job_, image_, views::samples_of(*canvas, *sharpener),
             inside == nullptr ? job_.stores_room() : nullptr, tiles[x]);
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
  const views::Sharpening sharpening_;
  const float before_inside_;
  const store::ColourDirectory image_;
  const DrawnCache blocks_;
};

/// Nobody looks for it by its key: it is as quickly drawn as it is read.
void draw_targets(job::JobContext& job, const mesh::Mesh& target, SceneViews& out) {
  const views::Grid& grid = out.grid;
  const store::ColourDirectory image = grid.image(views::kTargetSamples);
  const std::uint32_t across = grid.tiles_across();
  const auto bytes = [&](std::uint32_t rows) {
    return views::TargetDepths::bytes(grid, rows) + encoding_bytes(views::kTargetSamples) +
           2 * std::uint64_t{rows} * across * views::tile_bytes(views::kTargetSamples);
  };
  // All rows of a view at once if there is room: each band goes through all triangles.
  const std::uint64_t room =
      (job.budget.limit() - std::min(job.budget.limit(), job.budget.leased())) /
      (2 * std::uint64_t{job.threads});
  std::uint32_t band = across;
  while (band > 1 && bytes(band) > room) band = (band + 1) / 2;
  const std::uint32_t bands = (across + band - 1) / band;
  const std::vector<std::uint64_t> costs(std::size_t{grid.views()} * bands, bytes(band));
  const auto view_of = [&](std::size_t i) { return static_cast<std::uint32_t>(i / bands); };
  const auto first_of = [&](std::size_t i) { return static_cast<std::uint32_t>(i % bands) * band; };
  struct Drawn {
    std::vector<Row> rows, inside;
  };
  store::ColourStoreWriter writer(job.scratch->create(store::PackKind::colour, {}),
                                  image.tiles_y());
  store::ColourStoreWriter inside(job.scratch->create(store::PackKind::colour, kInsideTarget),
                                  image.tiles_y());
  bool shows_inside = false;
  runtime::run_ordered<Drawn>(
      job.budget, costs, "drawing the target from all around",
      [&](std::size_t i) {
        job.meter.throw_if_cancelled();
        const std::uint32_t first = first_of(i), count = std::min(band, across - first);
        const auto drawn = views::draw_target(target, grid, *out.kernels, view_of(i), first, count);
        Drawn tiles{{drawn.tile_rows, Row(across)}, {drawn.tile_rows, Row(across)}};
        for (std::uint32_t y = 0; y < drawn.tile_rows; ++y) {
          for (std::uint32_t x = 0; x < across; ++x) {
            if (!drawn.has(x, first + y)) continue;
            encode(job, image, drawn.tile(x, first + y), job.scratch_room(), tiles.rows[y][x]);
            const auto depths = drawn.inside(x, first + y, out.limits.on_target);
            if (!depths.empty()) encode(job, image, depths, nullptr, tiles.inside[y][x]);
          }
        }
        return tiles;
      },
      [&](std::size_t i, Drawn& tiles) {
        constexpr auto kBytes =
            static_cast<std::uint32_t>(views::tile_bytes(views::kTargetSamples));
        for (std::uint32_t y = 0; y < tiles.rows.size(); ++y) {
          const std::uint32_t row = grid.tile_row(view_of(i), first_of(i) + y);
          writer.add_row(row, tiles.rows[y], kBytes, job.compressor());
          inside.add_row(row, tiles.inside[y], kBytes, job.compressor());
          for (const auto& tile : tiles.inside[y]) shows_inside = shows_inside || !tile.empty();
        }
      });
  const auto finished = [&](store::ColourStoreWriter& one) {
    return opened(job, std::make_unique<store::ColourStore>(
                           publish_scratch(job, one.finish(image, job.compressor())), image,
                           job.compressor(), true));
  };
  out.target = finished(writer);
  if (shows_inside) out.inside_target = finished(inside);
}

}  // namespace

namespace {

/// Where the tiles are, in memory as long as the views, if the job needs that memory for nothing.
void hold_places(job::JobContext& job, SceneViews& out) {
  const store::ColourDirectory image = out.grid.image(views::kSceneSamples);
  const std::uint64_t tiles = std::uint64_t{image.tiles_x()} * image.tiles_y(),
                      bytes = 2 * tiles * sizeof(store::ChunkRef);
  if (job.report.least_memory_bytes + bytes > job.budget.limit()) return;
  out.tiles_lease = runtime::Lease(job.budget, bytes, "the places of the views' tiles");
  const auto places_of = [&](const ColourCache& cache) {
    std::vector<store::ChunkRef> places;
    places.reserve(tiles);
    for (std::uint32_t row = 0; row < image.tiles_y(); ++row) {
      const auto index = cache.index(row);
      places.insert(places.end(), index->begin(), index->end());
    }
    return places;
  };
  out.scene_tiles = places_of(*out.scene);
  out.target_tiles = places_of(*out.target);
}

}  // namespace

std::unique_ptr<ColourCache> drawn_scene(job::JobContext& job, const ViewsRequest& request,
                                         const views::Grid& grid, bool* cached) {
  auto scene = SceneDrawing(job, request, grid, 0).make(cached);
  job.count_store(scene->store().pack(), *cached);
  job.report.source_store_bytes += scene->store().pack().size_bytes();
  if (*cached) job.clock.set_cached("views");
  return scene;
}

SceneViews scene_views(job::JobContext& job, const ViewsRequest& request, const mesh::Mesh& target,
                       double diagonal, float edge, double progress_end) {
  SceneViews out{views::Grid(planning::box_of(target), edge, request.views),
                 {},
                 request.kernels,
                 nullptr,
                 nullptr};
  out.limits.on_target = out.grid.in_steps(static_cast<float>(views::kOnTarget * diagonal));
  out.limits.hidden = out.grid.in_steps(static_cast<float>(views::kHidden * diagonal));
  constexpr std::uint64_t kPairBytes =
      views::tile_bytes(views::kSceneSamples) + views::tile_bytes(views::kTargetSamples);
  out.stays_decoded = out.grid.tiles() * kPairBytes <= job.budget.limit() / 2;
  job.meter.begin("views", out.grid.image(views::kSceneSamples).tiles_y(), "rows", progress_end);
  bool cached = false;
  SceneDrawing drawing(job, request, out.grid,
                       out.grid.in_steps(static_cast<float>(views::kBeforeInside * diagonal)));
  out.scene = drawing.make(&cached);
  job.count_store(out.scene->store().pack(), cached);
  job.report.source_store_bytes += out.scene->store().pack().size_bytes();
  if (cached) job.clock.set_cached("views");
  job.report.views = out.grid.views();
  for (const Hash128& key : {Hash128{}, kInsideTarget, kInsideScene})
    out.go_with_it.push_back(std::make_unique<job::ScratchPack>(job, store::PackKind::colour, key));
  draw_targets(job, target, out);
  if (out.inside_target) out.inside_scene = drawing.make_inside(*out.inside_target);
  if (out.stays_decoded) hold_places(job, out);
  job.meter.end(cached);
  return out;
}

std::uint64_t scene_views_least_bytes(std::uint32_t lobes, std::uint64_t splats) {
  constexpr std::uint64_t kSplats = store::kMostSplatsPerBlock;
  constexpr std::uint64_t kFewInBlock = kSplats / 4;  // blocks are cut where neighbours part
  return sizeof(views::Canvas) + views::Slab::most_bytes(kLeastEllipses) +
         kSplats * (sizeof(store::Splat) + store::lobe_bytes(lobes)) +
         store::SplatBlock::decoded_bytes(kSplats, true, lobes) +
         gaussian::SplatColumns::most_bytes(kSplats, lobes) + places_bytes(splats / kFewInBlock) +
         encoding_bytes(views::kSceneSamples) + 3 * views::tile_bytes(views::kTargetSamples) +
         views::Grid::kMostAcross * views::tile_bytes(views::kSceneSamples);
}

}  // namespace pounce::flow
