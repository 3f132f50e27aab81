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
  for (const auto& column : columns) bytes += column->store().pack().bytes_read();
  return bytes;
}

ColourRequest request_of(const planning::ColumnPlan& column) {
  return {&column.image, &column.info, column.wrap_u, column.wrap_v, nullptr, column.trust};
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

WantedTiles tiles_shown(const job::JobContext& job, const planning::SourcePlan& plan,
                        WantedTiles wanted, std::uint64_t target_texels) {
  if (planning::is_seen_from_afar(plan, target_texels)) return {};
  for (std::size_t c = 0; c < wanted.size(); ++c) {
    // Building it later needs a lease beside the projection's. Where the budget has no space for
    // that, it is built whole now, when nothing else runs.
    const std::uint64_t later = colour_least_bytes(request_of(plan.columns[c]));
    if (job.report.least_memory_bytes + later > job.budget.limit()) wanted[c] = nullptr;
  }
  return wanted;
}

SourceColumns build_columns(job::JobContext& job, const planning::SourcePlan& plan,
                            const WantedTiles& wanted, double progress_end) {
  SourceColumns made;
  made.levels = std::make_unique<ColourLevels>(job);
  std::uint64_t rows = 0, later_bytes = 0;
  std::vector<ColourRequest> requests;
  std::vector<Hash128> keys, whole_keys;
  for (std::size_t c = 0; c < plan.columns.size(); ++c) {
    rows += (plan.columns[c].info.height + 63) / 64;
    requests.push_back(request_of(plan.columns[c]));
    if (c < wanted.size()) requests.back().wanted = wanted[c];
    if (requests.back().wanted != nullptr)
      later_bytes = std::max(later_bytes, colour_least_bytes(requests.back()));
  }
  // One lease for all of them: columns are completed one at a time, under JobContext::making.
  made.whole_lease = runtime::Lease(job.budget, later_bytes, "images that are read as a whole");
  job.meter.begin("source colours", rows, "rows of tiles", progress_end);
  // A column of some tiles has a key of its own. Levels belong to the whole image, whatever is kept
  // of it, so they follow the whole one's key.
  for (const ColourRequest& request : requests) {
    whole_keys.push_back(colour_key(job, request));
    keys.push_back(request.wanted == nullptr ? whole_keys.back()
                                             : some_tiles_key(whole_keys.back(), *request.wanted));
  }
  auto found = colour_stores(job, requests, keys);
  for (std::size_t c = 0; c < plan.columns.size(); ++c) {
    const planning::ColumnPlan& column = plan.columns[c];
    const bool cached = found[c].cached;
    made.all_cached = made.all_cached && cached;
    auto whole = requests[c].wanted == nullptr
                     ? nullptr
                     : std::make_shared<WholeColumn>(job, requests[c], whole_keys[c]);
    made.columns.push_back(std::make_unique<ColourCache>(
        job.budget, ColourReader{&job, std::move(found[c].store), std::move(whole)}));
    made.levels->add(*made.columns.back(), whole_keys[c]);
    const store::ColourStore& store = made.columns.back()->store();
    const std::uint64_t nonfinite = store.directory().nonfinite;
    if (nonfinite > 0) {
      job.report.source_filtered["nonfinite samples"] += nonfinite;
      job.report.warnings.push_back(fmt::format("{}: {} samples are NaN or infinite and count as 0",
                                                column.image.label, nonfinite));
    }
    job.count_store(store.pack(), cached);
    job.report.source_store_bytes += store.pack().size_bytes();
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
