// SPDX-License-Identifier: Apache-2.0
//
// A splat scene as a source.
//
// Its Gaussians are sorted once and serve all targets; what they are asked for (colour, confidence,
// distance) is decided when they are projected. A scene is rarely where a user thinks it is, so
// before a target's first page places strewn over the target look for the scene: whether it fits,
// and how far from the surface it lies at most places, is where texels begin to look.
#include "flow/sources/scene_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/stores/gaussian_store.h"
#include "gaussian/splat_statistics.h"
#include "planning/colour_spaces.h"
#include "planning/load_mesh.h"

namespace pounce::flow {
namespace {

/// The texels that a target's places stand for, whatever its images' size: of its diagonal.
constexpr double kPlaceEdge = 1.0 / 1024;

/// The confidence, without the fit, from which on a texel is covered.
double least_confidence(double min_confidence, double fit) {
  // Covered is a texel whose confidence times the fit reaches the minimum. Dividing the minimum
  // once is the same, and spares each texel the product.
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

}  // namespace

SceneSource::SceneSource(job::JobContext& job, const TransferOptions& options, bool for_model,
                         const job::TestKnobs& knobs)
    : Source(job, options),
      for_model_(for_model),
      splats_(options.splats),
      kernels_(&projection::splat_kernels(knobs.isa)),
      drawing_(&views::view_kernels(knobs.isa)),
      most_ellipses_(knobs.most_ellipses),
      request_(planning::splat_request(options)) {
  if (knobs.keeps_isolated) request_.fades = gaussian::FadeIsolated::of_no_scene;
}

void SceneSource::make_plan(job::MemoryNeeds& needs, planning::DiskPlan& disk,
                            const std::function<void(const mesh::Mesh&)>&) {
  facts_ = scene_facts(request_, [this] { job_.meter.advance(0); });
  plan_ = planning::plan_scene(options_, facts_, for_model_);
  files_ = facts_.files;
  needs.keep(plan_.table_bytes);
  disk.add_splats(facts_.splats, facts_.lobes, facts_.unpacked_bytes);
  if (request_.from_around) plan_.views = splats_.views;
  planning::move_to_origin(facts_.origin, request_);
  job_.report.origin = {facts_.origin.x, facts_.origin.y, facts_.origin.z};
  for (const std::string& assumption : facts_.assumptions) job_.note(assumption);
  job_.note(planning::origin_note(options_.source, facts_.origin));
  job_.meter.advance(1);
}

void SceneSource::meet(const planning::TargetPlan& target, const mesh::Mesh& mesh) {
  planning::keep_near(options_, target, mesh, request_);
}

std::vector<job::LeastMemory> SceneSource::build_needs() const {
  std::vector<job::LeastMemory> needs{{facts_.least_bytes, "sorting " + options_.source}};
  if (request_.from_around)
    needs.push_back({scene_views_least_bytes(facts_.lobes, facts_.splats),
                     "drawing " + options_.source + " from all around"});
  return needs;
}

std::uint64_t SceneSource::directory_bytes() const {
  constexpr std::uint64_t kMost = 64 << 10;  // of a pass, and of two pairs of views
  return kMost * (plan_.passes.size() + (request_.from_around ? 2 : 0));
}

std::uint64_t SceneSource::project_least_bytes(std::size_t pass) const {
  return project_splats_least_bytes(result_texel_bytes(pass), plan_.passes[pass].channels.size(),
                                    facts_.lobes, splats_.rays, request_.from_around);
}

void SceneSource::build(ProgressRange range, const planning::TargetDetail&, const BesideImages&) {
  const StageTimer timer(job_.clock, "precondition");
  job_.report.isa = kernels_->isa;
  const job::ScratchPack runs_go(job_, store::PackKind::splats);  // what the store is sorted from
  bool cached = false;
  store_ = splat_store(job_, request_, &cached, range.end);
  gaussians_ =
      std::make_unique<SplatCache>(job_.budget, SplatReader{{&job_, store_}, splats_.harmonics});
  const store::SplatDirectory& scene = gaussians_->store().directory();
  job_.report.depth_window = kWindowOverNoise * scene.surface_noise;
  job_.report.discness = gaussian::discness(scene.roundness, scene.thickness);
  job_.report.gaussian_size = scene.typical_size;
  directory_lease_ = count_splat_store(job_, gaussians_->store(), cached);
  job_.meter.keep(range.end);  // what of it the cache had
}

SplatProjection SceneSource::projection(const planning::TargetPlan& target_plan) const {
  SplatProjection request;
  request.source = gaussians_.get();
  request.kernels = kernels_;
  const store::SplatDirectory& scene = gaussians_->store().directory();
  request.linear = scene.is_linear;
  request.alpha = splats_.alpha;
  request.limits.reach = target_plan.max_distance;
  request.limits.min_cosine = min_cosine_;
  request.limits.window = kWindowOverNoise * scene.surface_noise;
  request.limits.discness = gaussian::discness(scene.roundness, scene.thickness);
  request.limits.fine_edge = gaussian::fine_edge(scene.typical_size);
  request.limits.antialiased = scene.model == store::SplatModel::antialiased;
  request.limits.rays = static_cast<int>(splats_.rays);
  request.smallest_edge = target_plan.smallest_edge;
  return request;
}

bool SceneSource::looks_around() const {
  if (splats_.look != Look::automatic) return splats_.look == Look::around;
  const store::SplatDirectory& scene = store_->directory();
  return !gaussian::is_made(scene.roundness, scene.thickness);
}

std::unique_ptr<SceneViews> SceneSource::views_of(const planning::TargetPlan& target_plan,
                                                  const mesh::Mesh& mesh, double area,
                                                  ProgressRange range) const {
  if (!looks_around()) return nullptr;
  const StageTimer timer(job_.clock, "views");
  const store::SplatDirectory& scene = store_->directory();
  ViewsRequest request;
  request.scene = store_;
  request.drawing = {scene.model == store::SplatModel::antialiased,
                     gaussian::fine_edge(scene.typical_size),
                     splats_.harmonics != SphericalHarmonics::dc};
  request.kernels = drawing_;
  request.views = splats_.views;
  request.path = options_.source;
  request.most_ellipses = most_ellipses_;
  // As if charts filled all pages, of the largest size.
  double texels = 1;
  for (const planning::PassPlan& pass : plan_.passes)
    texels = std::max(texels, static_cast<double>(pass.size.width) * pass.size.height *
                                  static_cast<double>(target_plan.pages.size()));
  const auto edge = static_cast<float>(std::sqrt(area / texels));
  return std::make_unique<SceneViews>(
      scene_views(job_, request, mesh, target_plan.diagonal, edge, range.end));
}

std::optional<projection::SplatFit> SceneSource::fit(
    std::span<const surface::Place> places, const planning::TargetPlan& target_plan) const {
  SplatProjection request = projection(target_plan);
  // Places look farther than texels, so that a scene which is just out of reach is found, too, and
  // the warning can state how far it is. Extra rays and their colours do not say where a surface
  // is.
  request.limits.reach = target_plan.fit_reach;
  request.limits.rays = 0;
  const auto edge = static_cast<float>(target_plan.diagonal * kPlaceEdge);
  return find_fit(job_, request, places, std::max(edge, target_plan.smallest_edge),
                  target_plan.usual_fit_reach);
}

std::unique_ptr<Projection> SceneSource::projector(std::size_t pass, std::uint32_t,
                                                   const store::GeometryStore& target,
                                                   const planning::TargetPlan& target_plan,
                                                   const Before& before) const {
  SplatProjection request = projection(target_plan);
  request.target = &target;
  for (const std::size_t c : plan_.passes[pass].channels) {
    // A scene states whether its colours are linear, and never other primaries than those of Rec.
    // 709.
    const planning::ChannelPlan& channel = plan_.channels[c];
    const auto input = colour_input({kRec709, request.linear}, request.linear, channel);
    request.outputs.push_back({channel.channel, channel.format, input});
  }
  request.views = before.views;
  request.fit = before.fit.fit;
  request.limits.least_confidence = least_confidence(splats_.min_confidence, before.fit.fit);
  expect_where_found(before.fit, request.limits);
  return project_splats(job_, request);
}

/// Most scenes show the same at any angle.
std::string SceneSource::cure() const {
  if (splats_.min_confidence <= TransferOptions{}.splats.min_confidence)
    return "align them, or raise --max-distance";
  return fmt::format("align them, raise --max-distance, or lower --min-confidence ({:g})",
                     splats_.min_confidence);
}

}  // namespace pounce::flow
