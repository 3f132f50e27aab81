// SPDX-License-Identifier: Apache-2.0
//
// The source of a job, preconditioned: built or found in the cache once, then put in front of one
// page of a target after the other. Decoded blocks stay from page to page as the budget allows.
#include "flow/build/source_stores.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "flow/build/texel_source.h"
#include "flow/load_mesh.h"
#include "flow/plan/colour_spaces.h"
#include "flow/project/gaussians.h"
#include "flow/project/splats.h"
#include "mesh/coincident.h"
#include "source/splat_shapes.h"
#include "target/layers.h"

namespace pounce::flow {
namespace {

/// The texels that a target's places stand for, whatever its images' size: of its diagonal.
constexpr double kPlaceEdge = 1.0 / 1024;

/// What a texel must be sure of before the fit is known, to be covered.
double least_confidence(double min_confidence, double fit) {
  constexpr double kNone = 2;  // no texel has that
  if (fit > 0) return min_confidence / fit;
  return min_confidence > 0 ? kNone : 0;
}

/// Texels look first where most places of the target found the scene: at least within a quarter of
/// what is thought where nothing is known, at most within all of it. Where most found it on one
/// side but do not agree how far away, it is no surface that they found, but what stands before it,
/// as furniture does before a wall: then the surface is where the target is.
void expect_where_found(const projection::SplatFit& fit, projection::SplatLimits& limits) {
  if (fit.fit < kLeastFit) return;
  constexpr float kPerSpread = 2, kMostOfReach = 1.0F / 3, kLeastOfReach = kMostOfReach / 4;
  const auto middle = static_cast<float>(fit.middle), spread = static_cast<float>(fit.spread);
  if (kPerSpread * spread > kMostOfReach * limits.reach && std::abs(middle) > spread) {
    limits.expected = 0;
    limits.deviation = kLeastOfReach * limits.reach;
    return;
  }
  limits.expected = std::clamp(middle, -limits.reach, limits.reach);
  limits.deviation =
      std::clamp(kPerSpread * spread, kLeastOfReach * limits.reach, kMostOfReach * limits.reach);
}

/// A search sees one of the triangles in a place: the first in file order, always.
void count_coincident(const Plan& plan, Report& report) {
  const auto pass = std::find_if(plan.passes.begin(), plan.passes.end(),
                                 [](const PassPlan& one) { return !one.has_shape; });
  if (pass == plan.passes.end()) return;  // no image is looked at
  const mesh::Mesh& mesh = *pass->source.mesh;
  const std::uint64_t count = mesh::count_coincident(mesh);
  if (count == 0) return;
  report.source_filtered["coincident triangles"] = count;
  report.warnings.push_back(fmt::format(
      "{}: {} of {} triangles lie exactly on others, with other UVs or another material; of each "
      "place the first in file order is shown. Leave out what is not meant: --source-mesh",
      mesh.path, count, mesh.triangles.size()));
}

}  // namespace

SourceStores::SourceStores(JobContext& job, const TransferOptions& options, const Plan& plan,
                           const std::string& isa, bool fades_isolated)
    : job_(job),
      options_(options),
      plan_(plan),
      isa_(isa),
      fades_isolated_(fades_isolated),
      kernels_(&projection::kernels(isa)) {
  job.report.isa = kernels_->isa;
}

void SourceStores::build(double begin, double end, std::uint64_t target_texels) {
  if (plan_.from_splats) {
    build_splats(end);
  } else if (plan_.as_gaussians) {
    build_texels(begin, end);
  } else {
    build_surface(begin, end, target_texels);
  }
  job_.meter.keep(end);  // what of it the cache had
}

void SourceStores::build_surface(double begin, double end, std::uint64_t target_texels) {
  {
    const StageTimer timer(job_.clock, "precondition");
    columns_ =
        build_columns(job_, plan_, tiles_shown(job_, plan_, target_texels), (begin + end) / 2);
    all_cached_ = columns_.all_cached;
  }
  build_geometry(end);
}

void SourceStores::build_geometry(double end) {
  const StageTimer timer(job_.clock, "precondition");
  job_.meter.begin("precondition", 0, "tiles", end);
  count_coincident(plan_, job_.report);
  find_layers();
  bool all_cached = true;
  for (const PassPlan& pass : plan_.passes) {
    bool cached = false;
    auto opened = geometry_store(job_, pass.source, &cached);
    all_cached = all_cached && cached;
    geometry_.push_back(std::make_unique<SurfaceCache>(
        job_.budget, SurfaceReader{{&job_, std::move(opened)}, pass.has_shape}));
    const store::GeometryStore& store = geometry_.back()->store();
    const store::GeometryDirectory& directory = store.directory();
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
  all_cached_ = all_cached_ && all_cached;
  if (all_cached_) job_.clock.set_cached("precondition");
  job_.meter.end(all_cached);
}

void SourceStores::find_layers() {
  constexpr std::size_t kEach = 4;      // of the places: a thousand tell shares well enough
  constexpr float kWithin = 1.0F / 50;  // of the source's diagonal
  std::vector<target::Place> some;
  for (std::size_t i = 0; i < plan_.places.size(); i += kEach) some.push_back(plan_.places[i]);
  const mesh::Mesh& mesh = *plan_.passes.front().source.mesh;
  Box3f box;
  for (const Vec3f& position : mesh.positions) box.extend(position);
  layer_gaps_ =
      target::layer_gaps(mesh, some, min_cosine(), kWithin * length(Vec3f(box.hi - box.lo)));
}

void SourceStores::build_splats(double end) {
  const StageTimer timer(job_.clock, "precondition");
  const ScratchPack runs_go(job_, store::PackKind::splats);  // what the store is sorted from
  bool cached = false;
  SplatRequest request = plan_.splats;
  request.fades_isolated = fades_isolated_;
  auto opened = splat_store(job_, request, &cached, end);
  splats_ = std::make_unique<SplatCache>(
      job_.budget, SplatReader{{&job_, std::move(opened)}, options_.splats.harmonics});
  const store::SplatDirectory& scene = splats_->store().directory();
  job_.report.depth_window = kWindowOverNoise * scene.surface_noise;
  job_.report.discness = source::discness(scene.roundness, scene.thickness);
  job_.report.gaussian_size = scene.typical_size;
  count_splats(cached);
}

void SourceStores::build_texels(double begin, double end) {
  const StageTimer timer(job_.clock, "precondition");
  const ScratchPack runs_go(job_, store::PackKind::splats);
  bool cached = false;
  auto opened = texel_store(job_, texels_of(plan_), &cached, begin, end);
  splats_ = std::make_unique<SplatCache>(
      job_.budget, SplatReader{{&job_, std::move(opened)}, options_.splats.harmonics});
  count_splats(cached);
}

void SourceStores::count_splats(bool cached) {
  if (cached) job_.clock.set_cached("precondition");
  const store::SplatStore& store = splats_->store();
  const store::SplatDirectory& directory = store.directory();
  job_.report.source_gaussians = directory.splats;
  job_.report.source_tiles = directory.tiles.size();
  job_.count_store(store.pack(), cached);
  job_.report.source_store_bytes += store.pack().size_bytes();
  leases_.emplace_back(job_.budget, store.size_bytes(), "the directory of the source store");
}

std::unique_ptr<Projection> SourceStores::projector(std::size_t pass,
                                                    const store::GeometryStore& target,
                                                    const TargetPlan& target_plan,
                                                    const projection::SplatFit& fit) const {
  return plan_.from_splats    ? splat_projector(pass, target, target_plan, fit)
         : plan_.as_gaussians ? gaussian_projector(target, target_plan)
                              : mesh_projector(pass, target, target_plan);
}

float SourceStores::min_cosine() const {
  return static_cast<float>(std::cos(options_.search.max_angle_deg * std::numbers::pi / 180));
}

SplatProjection SourceStores::splat_request(const TargetPlan& target_plan) const {
  SplatProjection request;
  request.source = splats_.get();
  request.kernels = &projection::splat_kernels(isa_);
  const store::SplatDirectory& scene = splats_->store().directory();
  request.linear = scene.is_linear;
  request.alpha = options_.splats.alpha;
  request.limits.reach = target_plan.max_distance;
  request.limits.min_cosine = min_cosine();
  request.limits.window = kWindowOverNoise * scene.surface_noise;
  request.limits.discness = source::discness(scene.roundness, scene.thickness);
  request.limits.fine_edge = source::fine_edge(scene.typical_size);
  request.limits.antialiased = scene.model == store::SplatModel::antialiased;
  request.limits.rays = static_cast<int>(plan_.rays);
  request.smallest_edge = target_plan.smallest_edge;
  return request;
}

std::optional<projection::SplatFit> SourceStores::fit(std::span<const target::Place> places,
                                                      const TargetPlan& target_plan) const {
  if (!plan_.from_splats) return std::nullopt;
  SplatProjection request = splat_request(target_plan);
  request.limits.reach = target_plan.fit_reach;
  request.limits.rays = 0;
  const auto edge = static_cast<float>(target_plan.diagonal * kPlaceEdge);
  return find_fit(job_, request, places, std::max(edge, target_plan.smallest_edge),
                  target_plan.usual_fit_reach);
}

std::unique_ptr<Projection> SourceStores::splat_projector(std::size_t pass,
                                                          const store::GeometryStore& target,
                                                          const TargetPlan& target_plan,
                                                          const projection::SplatFit& fit) const {
  SplatProjection request = splat_request(target_plan);
  request.target = &target;
  for (const std::size_t c : plan_.passes[pass].channels) {
    const ChannelPlan& channel = plan_.channels[c];
    const auto input = colour_input({kRec709, request.linear}, request.linear, channel);
    request.outputs.push_back({channel.channel, channel.format, input});
  }
  request.fit = fit.fit;
  request.limits.least_confidence = least_confidence(options_.splats.min_confidence, fit.fit);
  expect_where_found(fit, request.limits);
  return project_splats(job_, request);
}

std::unique_ptr<Projection> SourceStores::gaussian_projector(const store::GeometryStore& target,
                                                             const TargetPlan& target_plan) const {
  const ChannelPlan& channel = plan_.channels.front();
  GaussianProjection request;
  request.source = splats_.get();
  request.target = &target;
  request.format = channel.format;
  request.linear = texels_are_linear(plan_);
  request.has_alpha = channel.source_alpha;
  request.kernels = &projection::splat_kernels(isa_);
  request.limits.max_distance = target_plan.max_distance;
  request.limits.first_reach = first_reach(target_plan.diagonal, channel.size);
  request.limits.min_cosine = min_cosine();
  request.smallest_edge = target_plan.smallest_edge;
  return project_gaussians(job_, request);
}

std::optional<ShapeOutput> SourceStores::shape_of(const ChannelPlan& channel) const {
  if (!channel.has_shape()) return std::nullopt;
  ShapeOutput shape{
      channel.channel, channel.baked, options_.material.normal_y, options_.image.normal_y, {}, {},
      plan_.origin};
  for (const PageTexture& page : channel.pages) shape.scales.push_back(page.normal_scale);
  if (channel.channel == Channel::vertex_color)
    shape.input = colour_input({kRec709, true}, true, channel);
  return shape;
}

std::unique_ptr<Projection> SourceStores::mesh_projector(std::size_t pass,
                                                         const store::GeometryStore& target,
                                                         const TargetPlan& target_plan) const {
  MeshProjection request;
  request.source = geometry_[pass].get();
  request.target = &target;
  request.kernels = kernels_;
  request.lanes = &projection::blend_lanes(isa_);
  request.blend = projection::kernel_of(plan_.filter);
  request.levels = columns_.levels.get();
  request.limits.max_distance = target_plan.max_distance;
  request.limits.min_cosine = min_cosine();
  request.smallest_edge = target_plan.smallest_edge;
  for (const std::size_t c : plan_.passes[pass].channels) {
    const ChannelPlan& channel = plan_.channels[c];
    request.channels.push_back({channel.format, columns_.pages_of(channel), shape_of(channel)});
  }
  return project_mesh(job_, std::move(request));
}

const store::PackReader& SourceStores::pack(std::size_t pass) const {
  return splats_ != nullptr ? splats_->store().pack() : geometry_[pass]->store().pack();
}

Box3f SourceStores::box(std::size_t pass) const {
  return splats_ != nullptr ? splats_->store().directory().middle_box
                            : geometry_[pass]->store().directory().box;
}

std::uint64_t SourceStores::tiles_read() const {
  std::uint64_t tiles = splats_ == nullptr ? 0 : splats_->indices_read();
  for (const auto& geometry : geometry_) tiles += geometry->indices_read();
  return tiles;
}

}  // namespace pounce::flow
