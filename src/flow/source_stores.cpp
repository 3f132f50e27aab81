// SPDX-License-Identifier: Apache-2.0
#include "flow/source_stores.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "flow/load_mesh.h"
#include "flow/project_splats.h"

namespace pounce::flow {

SourceStores::SourceStores(JobContext& job, const TransferOptions& options, const Plan& plan)
    : job_(job),
      options_(options),
      plan_(plan),
      kernels_(&projection::kernels(options.internal.isa)) {
  job.report.isa = kernels_->isa;
}

void SourceStores::build(double begin, double end) {
  if (plan_.from_splats) return build_splats(end);
  build_columns((begin + end) / 2);
  build_geometry(end);
}

void SourceStores::build_columns(double end) {
  const StageTimer timer(job_.clock, "precondition");
  std::uint64_t rows = 0;
  for (const ColumnPlan& column : plan_.columns) rows += (column.info.height + 63) / 64;
  job_.meter.begin("source colours", rows, "rows of tiles", end);
  for (const ColumnPlan& column : plan_.columns) {
    bool cached = false;
    columns_.push_back(
        colour_store(job_, {&column.image, &column.info, column.wrap_u, column.wrap_v}, &cached));
    all_cached_ = all_cached_ && cached;
    const tiles::ColourDirectory& image = columns_.back()->directory();
    if (image.nonfinite > 0) {
      job_.report.source_filtered["nonfinite samples"] += image.nonfinite;
      job_.report.warnings.push_back(
          fmt::format("{}: {} samples are NaN or infinite and count as 0", column.image.label,
                      image.nonfinite));
    }
    job_.count_store(columns_.back()->pack(), cached);
    job_.report.source_store_bytes += columns_.back()->pack().size_bytes();
  }
  for (const TileSetPlan& set : plan_.tile_sets) {
    tile_sets_.push_back({set.size.width, set.size.height, {}});
    for (const auto& [tile, column] : set.columns)
      tile_sets_.back().tiles[tile] = columns_[column].get();
  }
  job_.meter.end();
}

void SourceStores::build_geometry(double end) {
  const StageTimer timer(job_.clock, "precondition");
  job_.meter.begin("precondition", 0, "tiles", end);
  for (const PassPlan& pass : plan_.passes) {
    bool cached = false;
    geometry_.push_back(geometry_store(job_, pass.source, &cached));
    all_cached_ = all_cached_ && cached;
    const tiles::GeometryStore& store = *geometry_.back();
    const tiles::GeometryDirectory& directory = store.directory();
    job_.report.source_gaussians = std::max(job_.report.source_gaussians, directory.texels);
    job_.report.source_tiles += directory.tiles.size();
    job_.count_store(store.pack(), cached);
    leases_.emplace_back(job_.budget, store.size_bytes(), "the directory of the source store");
    job_.report.source_store_bytes += store.pack().size_bytes();
    if (directory.degenerate > 0)
      job_.report.source_filtered["degenerate triangles"] = directory.degenerate;
    if (directory.slivers > 0)
      job_.report.source_filtered["triangles without a texel centre"] = directory.slivers;
  }
  if (all_cached_) job_.clock.set_cached("precondition");
  job_.meter.end();
}

void SourceStores::build_splats(double end) {
  const StageTimer timer(job_.clock, "precondition");
  const ScratchPack runs_go(job_, tiles::PackKind::splats);  // what the store is sorted from
  bool cached = false;
  splats_ =
      splat_store(job_, {options_.source, axes_of(options_.source_use, "source")}, &cached, end);
  if (cached) job_.clock.set_cached("precondition");
  const tiles::SplatDirectory& directory = splats_->directory();
  job_.report.source_gaussians = directory.splats;
  job_.report.source_tiles = directory.tiles.size();
  job_.report.depth_window = kWindowOverNoise * directory.surface_noise;
  job_.count_store(splats_->pack(), cached);
  job_.report.source_store_bytes = splats_->pack().size_bytes();
  leases_.emplace_back(job_.budget, splats_->size_bytes(), "the directory of the source store");
}

std::unique_ptr<PageProjector> SourceStores::projector(std::size_t pass,
                                                       const tiles::GeometryStore& target,
                                                       const TargetPlan& target_plan) const {
  return plan_.from_splats ? splat_projector(target, target_plan)
                           : mesh_projector(pass, target, target_plan);
}

float SourceStores::min_cosine() const {
  return static_cast<float>(std::cos(options_.max_angle_deg * std::numbers::pi / 180));
}

std::unique_ptr<PageProjector> SourceStores::splat_projector(const tiles::GeometryStore& target,
                                                             const TargetPlan& target_plan) const {
  SplatProjection request;
  request.source = splats_.get();
  request.target = &target;
  request.format = plan_.channels.front().format;
  request.kernels = &projection::splat_kernels(options_.internal.isa);
  request.limits.max_distance = target_plan.max_distance;
  request.limits.min_cosine = min_cosine();
  request.limits.window = kWindowOverNoise * splats_->directory().surface_noise;
  request.limits.antialiased = splats_->directory().model == tiles::SplatModel::antialiased;
  request.smallest_edge = target_plan.smallest_edge;
  return project_splats(job_, request);
}

std::unique_ptr<PageProjector> SourceStores::mesh_projector(std::size_t pass,
                                                            const tiles::GeometryStore& target,
                                                            const TargetPlan& target_plan) const {
  MeshProjection request;
  request.source = geometry_[pass].get();
  request.target = &target;
  request.kernels = kernels_;
  request.limits.max_distance = target_plan.max_distance;
  request.limits.min_cosine = min_cosine();
  request.smallest_edge = target_plan.smallest_edge;
  for (const std::size_t c : plan_.passes[pass].channels) {
    const ChannelPlan& channel = plan_.channels[c];
    ChannelOutput output{channel.format, {}};
    for (const PageTexture& page : channel.pages) {
      output.pages.push_back(
          {page.column < 0 ? nullptr : columns_[static_cast<std::size_t>(page.column)].get(),
           page.tile_set < 0 ? nullptr : &tile_sets_[static_cast<std::size_t>(page.tile_set)],
           page.constant});
    }
    request.channels.push_back(std::move(output));
  }
  return project_mesh(job_, std::move(request));
}

const tiles::PackReader& SourceStores::pack(std::size_t pass) const {
  return plan_.from_splats ? splats_->pack() : geometry_[pass]->pack();
}

Box3f SourceStores::box(std::size_t pass) const {
  return plan_.from_splats ? splats_->directory().middle_box : geometry_[pass]->directory().box;
}

}  // namespace pounce::flow
