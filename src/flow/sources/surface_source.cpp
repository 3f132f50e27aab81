// SPDX-License-Identifier: Apache-2.0
//
// A mesh as rays see it: what a texel's ray hits first is blended with its neighbours in the
// source's image (--method surface, the default).
//
// Images become columns of colour tiles and the surface becomes blocks of triangles, one store for
// each pass; neither knows of the other, so a repainted image leaves the geometry in the cache. A
// projection reads the blocks that its rays may meet, and the tiles around what they hit.
#include "flow/sources/surface_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "mesh/mesh.h"
#include "planning/colour_spaces.h"
#include "surface/layers.h"

namespace pounce::flow {

SurfaceSource::SurfaceSource(job::JobContext& job, const TransferOptions& options, bool for_model,
                             const job::TestKnobs& knobs)
    : MeshSource(job, options, planning::TexelsAs::surface, for_model),
      filter_(options.mesh.filter.value_or(kDefaultFilter)),
      source_y_(options.material.normal_y),
      output_y_(options.image.normal_y),
      kernels_(&projection::kernels(knobs.isa)),
      lanes_(&projection::blend_lanes(knobs.isa)) {}

void SurfaceSource::report_kind() { job_.report.filter = filter_name(filter_); }

void SurfaceSource::add_stores(planning::DiskPlan& disk) {
  little_shown_ = planning::little_shown(plan_);
  for (std::size_t c = 0; c < plan_.columns.size(); ++c)
    disk.add_seen_column(plan_.columns[c].info, little_shown_[c] != nullptr);
  for (const planning::PassPlan& pass : plan_.passes) disk.add_geometry(pass.source);
}

std::uint64_t SurfaceSource::project_least_bytes(std::size_t pass) const {
  // While planning no store exists. Its largest chunk is bounded by what a triangle takes before
  // compression; source_shape() has counted the most triangles of a block.
  constexpr std::uint64_t kStoredTriangle = 160, kColouredTriangle = 208, kChunk = 1 << 16;
  const planning::PassPlan& p = plan_.passes[pass];
  const std::uint64_t triangle = p.source.colours ? kColouredTriangle : kStoredTriangle;
  return flow::project_least_bytes(
      p.shape.most_triangles, p.shape.most_patches,
      static_cast<std::uint32_t>(p.shape.most_triangles * triangle + kChunk),
      result_texel_bytes(pass), colour_tile_bytes(plan_), p.has_shape || p.has_map);
}

void SurfaceSource::build(ProgressRange range, std::uint64_t target_texels) {
  job_.report.isa = kernels_->isa;
  {
    const StageTimer timer(job_.clock, "precondition");
    columns_ = build_columns(job_, plan_, tiles_shown(job_, plan_, little_shown_, target_texels),
                             (range.begin + range.end) / 2);
    all_cached_ = columns_.all_cached;
  }
  build_geometry(range.end);
  drop_mesh();
  job_.meter.keep(range.end);  // what of it the cache had
}

void SurfaceSource::build_geometry(double end) {
  const StageTimer timer(job_.clock, "precondition");
  // Layers are looked for here since the mesh goes after this. Whether they are too close is known
  // only when a target has been projected (docs/decisions/050-close-layers.md).
  job_.meter.begin("precondition", 0, "tiles", end);
  find_layers();
  bool all_cached = true;
  for (const planning::PassPlan& pass : plan_.passes) {
    bool cached = false;
    open_geometry(pass, &cached);
    all_cached = all_cached && cached;
  }
  warn_of_coincident();
  all_cached_ = all_cached_ && all_cached;
  if (all_cached_) job_.clock.set_cached("precondition");
  job_.meter.end(all_cached);
}

void SurfaceSource::open_geometry(const planning::PassPlan& pass, bool* cached) {
  auto opened = geometry_store(job_, pass.source, cached);
  geometry_.push_back(std::make_unique<SurfaceCache>(
      job_.budget, SurfaceReader{{&job_, std::move(opened)}, pass.has_shape}));
  const store::GeometryStore& store = geometry_.back()->store();
  const store::GeometryDirectory& directory = store.directory();
  // Passes see the same surface, each on a lattice of its own, so their numbers are not added.
  job_.report.source_gaussians = std::max(job_.report.source_gaussians, directory.texels);
  job_.report.source_tiles += directory.tiles.size();
  job_.count_store(store.pack(), *cached);
  leases_.emplace_back(job_.budget, store.size_bytes(), "the directory of the source store");
  job_.report.source_store_bytes += store.pack().size_bytes();
  if (directory.degenerate > 0)
    job_.report.source_filtered["degenerate triangles"] = directory.degenerate;
  if (directory.slivers > 0)
    job_.report.source_filtered["triangles without a texel centre"] = directory.slivers;
}

/// A search sees one of the triangles in a place: the first in file order, always. Where only the
/// shape is transferred no image is looked at.
void SurfaceSource::warn_of_coincident() {
  std::size_t pass = 0;
  while (pass < plan_.passes.size() && plan_.passes[pass].has_shape) ++pass;
  if (pass == plan_.passes.size()) return;
  const std::uint64_t count = geometry_[pass]->store().directory().coincident;
  if (count == 0) return;
  job_.report.source_filtered["coincident triangles"] = count;
  job_.warn(fmt::format(
      "{}: {} of {} triangles coincide with others that have different UVs or another material; "
      "only the first of them in file order is used. Select the intended parts with --source-mesh",
      mesh_.path, count, mesh_.triangles.size()));
}

void SurfaceSource::find_layers() {
  constexpr std::size_t kEach = 4;      // of the places: a thousand tell shares well enough
  constexpr float kWithin = 1.0F / 50;  // of the source's diagonal
  std::vector<surface::Place> some;
  for (std::size_t i = 0; i < places().size(); i += kEach) some.push_back(places()[i]);
  Box3f box;
  for (const Vec3f& position : mesh_.positions) box.extend(position);
  layer_gaps_ =
      surface::layer_gaps(mesh_, some, min_cosine_, kWithin * length(Vec3f(box.hi - box.lo)));
}

std::optional<shading::ShapeOutput> SurfaceSource::shape_of(
    const planning::ChannelPlan& channel) const {
  // What shading asks of the surface itself: how to read a normal map of each page, or what to
  // bake.
  if (!channel.has_shape()) return std::nullopt;
  shading::ShapeOutput shape{channel.channel, channel.baked, source_y_, output_y_, {}, {},
                             plan_.origin};
  for (const planning::PageTexture& page : channel.pages) shape.scales.push_back(page.normal_scale);
  if (channel.channel == Channel::vertex_color)
    shape.input = colour_input({kRec709, true}, true, channel);
  return shape;
}

std::unique_ptr<Projection> SurfaceSource::projector(std::size_t pass, std::uint32_t,
                                                     const store::GeometryStore& target,
                                                     const planning::TargetPlan& target_plan,
                                                     const projection::SplatFit&) const {
  MeshProjection request;
  request.source = geometry_[pass].get();
  request.target = &target;
  request.kernels = kernels_;
  request.lookup = {lanes_, projection::kernel_of(filter_), columns_.levels.get()};
  request.limits.max_distance = target_plan.max_distance;
  request.limits.min_cosine = min_cosine_;
  request.smallest_edge = target_plan.smallest_edge;
  for (const std::size_t c : plan_.passes[pass].channels) {
    const planning::ChannelPlan& channel = plan_.channels[c];
    request.channels.push_back({channel.format,
                                columns_.pages_of(channel, plan_.passes[pass].source.pages),
                                shape_of(channel), channel.channel == Channel::hits});
  }
  return project_mesh(job_, std::move(request));
}

std::uint64_t SurfaceSource::bytes_read(std::size_t pass) const {
  return geometry_[pass]->store().pack().bytes_read();
}

Box3f SurfaceSource::box() const { return geometry_.front()->store().directory().box; }

std::uint64_t SurfaceSource::tiles_read() const {
  std::uint64_t tiles = 0;
  for (const auto& geometry : geometry_) tiles += geometry->indices_read();
  return tiles;
}

}  // namespace pounce::flow
