// SPDX-License-Identifier: Apache-2.0
//
// A textured mesh as a source, as far as it does not matter what becomes of its texels: it is read,
// planned and held, and says what building its stores takes.
//
// The mesh is the largest thing that planning leaves in memory. It stays for the plan, the tangents
// and the places, and for build(), which turns it into blocks; then it goes. The requests of the
// passes still point to it: of these only the pages may be used from then on.
#include "flow/sources/mesh_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "flow/project/gaussians.h"
#include "flow/stores/build_stores.h"
#include "flow/stores/gaussian_store.h"
#include "io/read_mesh.h"
#include "job/run_job.h"
#include "mesh/mesh.h"
#include "mesh/tangent_space.h"
#include "planning/colour_spaces.h"
#include "planning/describe_job.h"
#include "planning/job_hash.h"
#include "planning/load_mesh.h"
#include "projection/mesh_fit.h"
#include "surface/strewn_places.h"

namespace pounce::flow {

void MeshSource::make_plan(job::MemoryNeeds& needs, planning::DiskPlan& disk,
                           const std::function<void(const mesh::Mesh&)>& check_order) {
  read();
  // Before planning, which would report a swapped pair as missing textures.
  check_order(mesh_);
  // A new plan knows no origin; it was decided when the mesh was read.
  const Vec3d origin = plan_.origin;
  plan_ = planning::plan_mesh(options_, mesh_, as_, for_model_, job_.merges_materials);
  plan_.origin = origin;
  places_ = surface::strew(mesh_, projection::kSourcePlaces);
  needs.keep(plan_.table_bytes);
  if (plan_.tangents) add_tangents(needs);
  add_stores(disk);
  report_plan();
}

void MeshSource::read() {
  const std::string& path = options_.source;
  require_early(job_, {reading_bytes(), "reading " + path}, 0);
  planning::PlacedMesh placed =
      planning::place_mesh(path, options_.source_use, "source", options_.allow_external);
  mesh_ = std::move(placed.mesh);
  files_ = mesh_.files;
  plan_.origin = placed.origin;
  job_.report.origin = {placed.origin.x, placed.origin.y, placed.origin.z};
  for (const std::string& warning : mesh_.warnings) job_.warn(warning);
  for (const std::string& note : mesh_.notes) job_.note(note);
  job_.note(planning::origin_note(path, placed.origin));
  job_.meter.advance(1);
}

/// Said before they are made: a mesh whose tangents need far more than there is takes long.
void MeshSource::add_tangents(job::MemoryNeeds& needs) {
  needs.add_now(mesh_.size_bytes() + mesh::tangents_bytes(mesh_), "the tangents of " + mesh_.path,
                mesh_.size_bytes());
  mesh::set_tangents(mesh_, plan_.tangents->uv_sets, plan_.tangents->keeps_own);
}

void MeshSource::report_plan() {
  for (const planning::ChannelPlan& channel : plan_.channels) {
    if (channel.channel == Channel::position)
      job_.note(planning::positions_note(plan_.origin, channel.format.depth));
  }
  report_kind();
  job_.note(planning::not_transferred(options_, plan_, mesh_));
  if (!for_model_) job_.note(planning::factors_note(options_, plan_, mesh_));
  const std::string coarse =
      planning::coarse_positions(mesh_, plan_.origin, plan_.passes.front().size);
  if (!coarse.empty()) plan_.warnings.push_back(coarse);
}

void MeshSource::lease_held() {
  mesh_lease_ = runtime::Lease(job_.budget, mesh_.size_bytes(), "the source's mesh");
}

void MeshSource::drop_mesh() {
  mesh_ = {};
  mesh_lease_ = {};
}

std::uint64_t MeshSource::reading_bytes() const {
  return io::mesh_cost(options_.source, {options_.allow_external, {}, true}, job_.budget.limit())
      .peak_bytes;
}

std::vector<job::LeastMemory> MeshSource::build_needs() const {
  std::vector<job::LeastMemory> needs = column_needs(plan_);
  for (job::LeastMemory& need : further_needs()) needs.push_back(std::move(need));
  needs.push_back({geometry_least_bytes(), "preconditioning " + mesh_.path});
  return needs;
}

std::uint64_t MeshSource::geometry_least_bytes() const {
  std::uint64_t bytes = 0;
  for (const planning::PassPlan& pass : plan_.passes)
    bytes = std::max(bytes, surface::geometry_least_bytes(pass.source, job_.tile_cap_bytes));
  return bytes;
}

std::uint64_t MeshSource::directory_bytes() const {
  std::uint64_t bytes = 0;
  for (const planning::PassPlan& pass : plan_.passes)
    bytes += surface::geometry_directory_bytes(pass.source, job_.tile_cap_bytes);
  return bytes;
}

std::size_t MeshSource::target_places() const { return projection::kTargetPlaces; }

// --- what rays see of it -------------------------------------------------------------------------
//
// A mesh as rays see it: what a texel's ray hits first is blended with its neighbours in the
// source's image (--method surface, the default).
//
// Images become columns of colour tiles and the surface becomes blocks of triangles, one store for
// each pass; neither knows of the other, so a repainted image leaves the geometry in the cache. A
// projection reads the blocks that its rays may meet, and the tiles around what they hit.

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
  // compression; its triangles are counted.
  constexpr std::uint64_t kStoredTriangle = 160, kColouredTriangle = 208, kChunk = 1 << 16;
  const planning::PassPlan& p = plan_.passes[pass];
  const std::uint64_t triangle = p.source.colours ? kColouredTriangle : kStoredTriangle;
  const std::uint32_t most = surface::most_in_source_block(p.source);
  return flow::project_least_bytes(
      most, static_cast<std::uint32_t>(most * triangle + kChunk), result_texel_bytes(pass),
      shading_bytes(colour_tile_bytes(plan_)), p.has_shape || p.has_map);
}

void SurfaceSource::build(ProgressRange range, const planning::TargetDetail& targets,
                          const BesideImages& ahead) {
  job_.report.isa = kernels_->isa;
  const StageTimer timer(job_.clock, "precondition");
  // An image is decoded by one thread, and neither surface needs it.
  std::vector<MadeGeometry> geometry;
  BesideImages beside{[&] {
                        geometry = make_geometry();
                        if (ahead.make) ahead.make();
                      },
                      std::max(geometry_least_bytes(), ahead.least_bytes) + directory_bytes()};
  columns_ = build_columns(job_, plan_, stored_parts(job_, plan_, little_shown_, targets),
                           (range.begin + range.end) / 2, &beside);
  all_cached_ = columns_.all_cached;
  job_.meter.begin("precondition", 0, "tiles", range.end);
  if (!beside.is_made) geometry = make_geometry();
  open_geometry(std::move(geometry));
  drop_mesh();
  job_.meter.keep(range.end);  // what of it the cache had
}

std::vector<SurfaceSource::MadeGeometry> SurfaceSource::make_geometry() {
  // Layers are looked for here since the mesh goes after this. Whether they are too close is known
  // only when a target has been projected (docs/decisions/050-close-layers.md).
  find_layers();
  std::vector<MadeGeometry> made;
  for (const planning::PassPlan& pass : plan_.passes) {
    MadeGeometry& one = made.emplace_back();
    one.store = geometry_store(job_, pass.source, &one.cached);
    one.directory =
        runtime::Lease(job_.budget, one.store->size_bytes(), "the directory of the source store");
  }
  return made;
}

void SurfaceSource::open_geometry(std::vector<MadeGeometry> made) {
  bool all_cached = true;
  for (std::size_t p = 0; p < made.size(); ++p) {
    all_cached = all_cached && made[p].cached;
    open_pass(plan_.passes[p], std::move(made[p]));
  }
  warn_of_coincident();
  all_cached_ = all_cached_ && all_cached;
  if (all_cached_) job_.clock.set_cached("precondition");
  job_.meter.end(all_cached);
}

void SurfaceSource::open_pass(const planning::PassPlan& pass, MadeGeometry made) {
  geometry_.push_back(std::make_unique<SurfaceCache>(
      job_.budget, SurfaceReader{{&job_, std::move(made.store)}, pass.has_shape}));
  const store::GeometryStore& store = geometry_.back()->store();
  const store::GeometryDirectory& directory = store.directory();
  // Passes see the same surface, each on a lattice of its own, so their numbers are not added.
  job_.report.source_gaussians = std::max(job_.report.source_gaussians, directory.texels);
  job_.report.source_tiles += directory.tiles.size();
  job_.count_store(store.pack(), made.cached);
  leases_.push_back(std::move(made.directory));
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
                                                     const Before&) const {
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

// --- its texels as Gaussians ---------------------------------------------------------------------
//
// A mesh as the paper has it: every texel is a Gaussian on the surface, and a target's texel blends
// all that its ray meets (--method gaussian, docs/paper.md).
//
// Columns of colours and blocks of triangles are what the Gaussians are made from (sources/
// texel_source.h); sorted into one store they are all that a projection reads, so where the cache
// has that store no image and no triangle is looked at.

namespace {

/// Raised whenever the same mesh and images would make other Gaussians.
constexpr std::uint32_t kTexelSourceVersion = 1;

}  // namespace

TexelsSource::TexelsSource(job::JobContext& job, const TransferOptions& options, bool for_model,
                           const job::TestKnobs& knobs)
    : MeshSource(job, options, planning::TexelsAs::gaussians, for_model),
      sigma_(options.mesh.sigma_texels.value_or(kDefaultSigma)),
      densify_(options.mesh.densify),
      kernels_(&projection::splat_kernels(knobs.isa)) {}

void TexelsSource::report_kind() {
  job_.report.sigma_texels = sigma_;
  job_.report.densify = densify_;
}

void TexelsSource::add_stores(planning::DiskPlan& disk) {
  for (const planning::ColumnPlan& column : plan_.columns) disk.add_column(column.info);
  disk.add_geometry(geometry());
  disk.add_splats(most_gaussians(), 0, 0);
}

/// Splitting makes at most three of one, on average.
std::uint64_t TexelsSource::most_gaussians() const {
  return texel_count_bound(geometry()) * (densify_ ? 4 : 1);
}

std::vector<job::LeastMemory> TexelsSource::further_needs() const {
  const std::uint64_t triangles =
      std::min<std::uint64_t>(mesh_.triangles.size(), store::kMostTrianglesPerBlock);
  const std::uint64_t reading =
      TexelSource::read_bytes(triangles, triangles * 160 + (1 << 16), colour_tile_bytes(plan_));
  // The list of blocks is in memory beside each step of the sort.
  const std::uint64_t lists = TexelSource::list_bytes(geometry());
  return {{lists + reading, "counting the texels of " + mesh_.path},
          {lists + gaussian_store_least_bytes(most_gaussians(), reading, 0),
           "sorting the texels of " + mesh_.path}};
}

std::uint64_t TexelsSource::project_least_bytes(std::size_t pass) const {
  return project_gaussians_least_bytes(result_texel_bytes(pass));
}

void TexelsSource::build(ProgressRange range, const planning::TargetDetail&, const BesideImages&) {
  const StageTimer timer(job_.clock, "precondition");
  job_.report.isa = kernels_->isa;
  const job::ScratchPack runs_go(job_, store::PackKind::splats);  // what the store is sorted from
  // The key needs hashes of all images, but no decoding: a job that finds its store reads the mesh,
  // the hashes and the store.
  const Hash128 key = store_key();
  auto store =
      find_store(job_, store::PackKind::splats, key, [&](std::unique_ptr<store::PackReader> pack) {
        return std::make_unique<store::SplatStore>(std::move(pack), store::SplatFacts{},
                                                   job_.compressor());
      });
  const bool cached = store != nullptr;
  if (!cached) store = sort(key, range);
  report_filtered(job_, *store);
  splats_ = std::make_unique<SplatCache>(job_.budget, SplatReader{{&job_, std::move(store)}});
  directory_lease_ = count_splat_store(job_, splats_->store(), cached);
  drop_mesh();
  job_.meter.keep(range.end);  // what of it the cache had
}

std::unique_ptr<store::SplatStore> TexelsSource::sort(const Hash128& key,
                                                      ProgressRange range) const {
  // Columns and blocks are needed while Gaussians are made, not afterwards: both are closed when
  // this returns, and their memory with them.
  const auto until = [&](double share) { return range.begin + (range.end - range.begin) * share; };
  const SourceColumns columns = build_columns(job_, plan_, {}, until(0.2));
  job_.meter.begin("precondition", 0, "tiles", until(0.3));
  bool cached = false;
  const auto blocks = geometry_store(job_, geometry(), &cached);
  job_.count_store(blocks->pack(), cached);
  job_.meter.end();
  if (const std::uint64_t degenerate = blocks->directory().degenerate; degenerate > 0)
    job_.report.source_filtered["degenerate triangles"] = degenerate;
  const runtime::Lease lease(job_.budget, blocks->size_bytes(),
                             "the directory of the source store");
  const TexelSource source(
      job_,
      {blocks.get(), columns.pages_of(plan_.channels.front(), plan_.passes.front().source.pages),
       sigma_, densify_, planning::texels_are_linear(plan_)},
      until(0.4));
  job_.meter.begin("sort", 2 * source.count(), "Gaussians", range.end);
  auto made = build_gaussian_store(
      job_, {&source, key, mesh_.path, {}, {}, gaussian::FadeIsolated::of_no_scene, 0, 0});
  job_.meter.end();
  job_.report.bytes_read += blocks->pack().bytes_read() + columns.bytes_read();
  return made;
}

Hash128 TexelsSource::store_key() const {
  // All that a Gaussian is made of, by content. A term that is missing here is found by no check: a
  // job with other options would get these Gaussians from the cache.
  std::vector<Hash128> columns;
  for (const planning::ColumnPlan& column : plan_.columns)
    columns.push_back(colour_key(job_, request_of(column)));
  Hasher hash;
  hash.add(std::string_view("texels"));
  hash.add(store::kFormatVersion);
  hash.add(kGaussianStoreVersion);
  hash.add(kTexelSourceVersion);
  hash.add(surface::geometry_key(geometry()));
  for (const planning::PageTexture& page : plan_.channels.front().pages)
    planning::add_page(page, columns, hash);
  hash.add(static_cast<std::uint64_t>(plan_.tile_sets.size()));
  for (const planning::TileSetPlan& set : plan_.tile_sets)
    planning::add_tile_set(set, columns, hash);
  hash.add(sigma_);
  hash.add(densify_);
  return hash.digest();
}

std::unique_ptr<Projection> TexelsSource::projector(std::size_t, std::uint32_t,
                                                    const store::GeometryStore& target,
                                                    const planning::TargetPlan& target_plan,
                                                    const Before&) const {
  const planning::ChannelPlan& channel = plan_.channels.front();
  GaussianProjection request;
  request.source = splats_.get();
  request.target = &target;
  request.format = channel.format;
  request.linear = planning::texels_are_linear(plan_);
  request.has_alpha = channel.source_alpha;
  request.kernels = kernels_;
  request.limits.max_distance = target_plan.max_distance;
  request.limits.first_reach = first_reach(target_plan.diagonal, channel.size);
  request.limits.min_cosine = min_cosine_;
  request.smallest_edge = target_plan.smallest_edge;
  return project_gaussians(job_, request);
}

}  // namespace pounce::flow
