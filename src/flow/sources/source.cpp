// SPDX-License-Identifier: Apache-2.0
//
// Which kind of source a job has. From here on nobody asks: each kind knows what it is.
//
// A cosine of the C library may differ in its last place from machine to machine. It is computed
// once, here, and not per texel (docs/same-bytes.md).
#include "flow/sources/source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "flow/sources/map_source.h"
#include "flow/sources/mesh_source.h"
#include "flow/sources/scene_source.h"

namespace pounce::flow {

std::uint64_t Source::result_texel_bytes(std::size_t pass) const {
  std::uint64_t bytes = 0;
  for (const std::size_t c : plan_.passes[pass].channels)
    bytes += plan_.channels[c].format.texel_bytes();
  return bytes;
}

Source::Source(job::JobContext& job, const TransferOptions& options)
    : job_(job),
      options_(options),
      min_cosine_(
          static_cast<float>(std::cos(options.search.max_angle_deg * std::numbers::pi / 180))) {}

std::unique_ptr<Source> open_source(job::JobContext& job, const TransferOptions& options,
                                    bool for_model, const job::TestKnobs& knobs) {
  if (planning::is_hit_map(options.source)) return std::make_unique<MapSource>(job, options, knobs);
  if (planning::is_splat_scene(options.source)) {
    planning::refuse_mesh_options(options);
    return std::make_unique<SceneSource>(job, options, for_model, knobs);
  }
  planning::refuse_splat_options(options);
  if (options.mesh.method == Method::gaussian)
    return std::make_unique<TexelsSource>(job, options, for_model, knobs);
  return std::make_unique<SurfaceSource>(job, options, for_model, knobs);
}

// --- its images ----------------------------------------------------------------------------------
//
// The images of a mesh, opened as columns of colour tiles, and which of their tiles are stored at
// all.
//
// A mesh may show a corner of an atlas only. Then the tiles around its triangles are kept, and rows
// below the last of them are not even decoded (docs/stages/1-precondition.md). That is a guess
// which must be safe to get wrong: a lookup may reach a tile that was left out, and a level is made
// of the whole image. WholeColumn then builds the image as a whole, in the middle of the
// projection. The result is the same, so the guess may depend on the budget.
//
// Three kinds of images are kept whole from the start: those of few tiles, those of UDIM sets, and
// all of a job whose targets see many source texels at once and would need levels anyway.
//
// Of an image that is seen from so far that hardly anybody looks at itself, a level is stored in
// its place, in the making of which no more than a strip is ever there. The guess is as safe: who
// asks for a finer level has the image built as a whole.

std::vector<PageColour> SourceColumns::pages_of(const planning::ChannelPlan& channel,
                                                const std::vector<mesh::Lattice>& lattices) const {
  std::vector<PageColour> pages;
  for (std::size_t p = 0; p < channel.pages.size(); ++p) {
    const planning::PageTexture& page = channel.pages[p];
    // Pages of triangles without UVs have constants: no lattice is asked for there.
    const ImageSize lattice =
        p < lattices.size() ? ImageSize{lattices[p].width, lattices[p].height} : ImageSize{};
    pages.push_back(
        {lattice, page.column < 0 ? nullptr : columns[static_cast<std::size_t>(page.column)].get(),
         page.tile_set < 0 ? nullptr : &tile_sets[static_cast<std::size_t>(page.tile_set)],
         page.constant, page.input, page.factor, page.tinted});
  }
  return pages;
}

std::uint64_t SourceColumns::bytes_read() const {
  std::uint64_t bytes = 0;
  for (const auto& column : columns) {
    if (column->store().has_pack()) bytes += column->store().pack().bytes_read();
  }
  return bytes;
}

ColourRequest request_of(const planning::ColumnPlan& column) {
  return {&column.image, &column.info, column.wrap_u, column.wrap_v, nullptr, column.trust, 0};
}

std::vector<job::LeastMemory> column_needs(const planning::SourcePlan& plan) {
  std::vector<job::LeastMemory> needs;
  for (const planning::ColumnPlan& column : plan.columns)
    needs.push_back({colour_least_bytes(request_of(column)), "reading " + column.image.label});
  return needs;
}

std::uint64_t colour_tile_bytes(const planning::SourcePlan& plan) {
  std::uint64_t tile = 0;
  for (const planning::ColumnPlan& column : plan.columns) {
    const std::uint64_t texel = column.info.channels * store::depth_bytes(column.info.depth);
    tile = std::max(tile, round_to_pages(store::kColourTileEdge * store::kColourTileEdge * texel));
  }
  return tile;
}

StoredParts stored_parts(const job::JobContext& job, const planning::SourcePlan& plan,
                         const planning::WantedTiles& shown,
                         const planning::TargetDetail& targets) {
  StoredParts parts{{}, planning::seen_levels(plan, targets)};
  if (!planning::is_seen_from_afar(plan, targets)) parts.tiles = shown;
  for (std::size_t c = 0; c < plan.columns.size(); ++c) {
    // Building it later needs a lease beside the projection's. Where the budget has no space for
    // that, it is built whole now, when nothing else runs.
    const std::uint64_t later = colour_least_bytes(request_of(plan.columns[c]));
    const bool has_space = job.report.least_memory_bytes + later <= job.budget.limit();
    if (!has_space) parts.levels[c] = 0;
    if (c < parts.tiles.size() && (!has_space || parts.levels[c] > 0)) parts.tiles[c] = nullptr;
  }
  return parts;
}

namespace {

/// What reads an image of which `store` has a level, some tiles or all.
std::unique_ptr<ColourCache> column_cache(job::JobContext& job, const ColourRequest& request,
                                          const Hash128& whole_key,
                                          std::unique_ptr<store::ColourStore> store,
                                          ColourLevels& levels) {
  std::shared_ptr<WholeColumn> whole;
  if (request.wanted != nullptr || request.level > 0)
    whole = std::make_shared<WholeColumn>(job, request, whole_key);
  std::unique_ptr<store::ColourStore> level;
  if (request.level > 0) {
    level = std::move(store);
    store = std::make_unique<store::ColourStore>(image_directory(request));
  }
  auto cache =
      std::make_unique<ColourCache>(job.budget, ColourReader{&job, std::move(store), whole});
  levels.add(*cache, whole_key);
  if (level != nullptr) levels.add_made(*cache, request.level, std::move(level));
  return cache;
}

}  // namespace

SourceColumns build_columns(job::JobContext& job, const planning::SourcePlan& plan,
                            const StoredParts& parts, double progress_end, BesideImages* beside) {
  SourceColumns made;
  made.levels = std::make_unique<ColourLevels>(job);
  std::uint64_t rows = 0, later_bytes = 0;
  std::vector<ColourRequest> requests;
  std::vector<Hash128> keys, whole_keys;
  for (std::size_t c = 0; c < plan.columns.size(); ++c) {
    requests.push_back(request_of(plan.columns[c]));
    ColourRequest& request = requests.back();
    if (c < parts.tiles.size()) request.wanted = parts.tiles[c];
    if (c < parts.levels.size()) request.level = parts.levels[c];
    rows += ((plan.columns[c].info.height >> request.level) + 63) / 64;
    if (request.wanted != nullptr || request.level > 0)
      later_bytes = std::max(later_bytes, colour_least_bytes(request));
  }
  // One lease for all of them: columns are completed one at a time, under JobContext::making.
  made.whole_lease = runtime::Lease(job.budget, later_bytes, "images that are read as a whole");
  job.meter.begin("source colours", rows, "rows of tiles", progress_end);
  // A column of some tiles has a key of its own. Levels belong to the whole image, whatever is kept
  // of it, so they follow the whole one's key.
  for (const ColourRequest& request : requests) {
    const Hash128& whole = whole_keys.emplace_back(colour_key(job, request));
    keys.push_back(request.level > 0           ? level_key(whole, request.level)
                   : request.wanted != nullptr ? some_tiles_key(whole, *request.wanted)
                                               : whole);
  }
  auto found = colour_stores(job, requests, keys, beside);
  for (std::size_t c = 0; c < plan.columns.size(); ++c) {
    const planning::ColumnPlan& column = plan.columns[c];
    const bool cached = found[c].cached;
    made.all_cached = made.all_cached && cached;
    const store::ColourStore& store = *found[c].store;
    const std::uint64_t nonfinite = store.directory().nonfinite;
    if (nonfinite > 0) {
      job.report.source_filtered["nonfinite samples"] += nonfinite;
      job.report.warnings.push_back(fmt::format("{}: {} samples are NaN or infinite and count as 0",
                                                column.image.label, nonfinite));
    }
    job.count_store(store.pack(), cached);
    job.report.source_store_bytes += store.pack().size_bytes();
    made.columns.push_back(
        column_cache(job, requests[c], whole_keys[c], std::move(found[c].store), *made.levels));
  }
  for (const planning::TileSetPlan& set : plan.tile_sets) {
    made.tile_sets.emplace_back();
    for (const auto& [tile, column] : set.columns) {
      const auto input = set.inputs.find(tile);
      made.tile_sets.back().tiles[tile] = {
          made.columns[column].get(),
          input == set.inputs.end() ? std::nullopt : std::optional(input->second)};
    }
  }
  job.meter.end(made.all_cached);
  return made;
}

}  // namespace pounce::flow
