// SPDX-License-Identifier: Apache-2.0
//
// A scene's file as a source of Gaussians: rows in any order, hashed once, sorted into a store.
//
// One scene serves many targets, so its store knows of none, unless that would waste most of the
// work: where no more than a quarter of a sample is near the job's targets, what is far from them
// is left out, and the store's key says what was near (docs/decisions/024-near-target.md).
#include "flow/stores/splats.h"

#include <algorithm>

#include "flow/stores/build_stores.h"
#include "flow/stores/gaussian_store.h"

namespace pounce::flow {
namespace {

/// A store of its own for these targets is worth it where it holds no more than one in so many, but
/// some: a scene in other units, or elsewhere, is sorted as a whole, so that the job can say so.
constexpr std::size_t kWorthLeavingOut = 4;

std::uint32_t kept_lobes(const io::SplatSceneInfo& info, const planning::SplatRequest& request) {
  const std::uint32_t of_file = store::kLobesOfDegree[std::min<std::size_t>(
      info.sh_degree, store::kLobesOfDegree.size() - 1)];
  switch (request.harmonics) {
    case SphericalHarmonics::dc:
      return 0;
    case SphericalHarmonics::normal:
      return of_file;
    case SphericalHarmonics::mean:  // the hemisphere's mean of degree 3 is 0
      return request.from_around ? of_file : std::min(of_file, store::kLobesOfDegree[2]);
  }
  return 0;
}

/// A scene on its way into a store.
class SceneStore {
 public:
  SceneStore(job::JobContext& job, const planning::SplatRequest& request)
      : job_(job),
        request_(request),
        scene_(open(job, request)),
        source_(*scene_, kept_lobes(scene_->info(), request)) {}

  std::uint64_t count() const { return source_.count(); }

  std::unique_ptr<store::SplatStore> make(bool* cached) {
    // By default what is near the targets is only a suggestion: whether it is worth a store of its
    // own depends on a sample, which for SPZ and SOG means unpacking the scene. A store that exists
    // answers the question without it. The answer must not depend on the cache otherwise, since the
    // surface noise is measured on what was sorted (docs/decisions/024-near-target.md).
    gaussian::SplatKeep keep = request_.keep;
    *cached = true;
    const bool is_suggested = !keep.near.empty() && !request_.near_is_asked;
    if (auto found = find(keep)) return found;
    if (is_suggested && !is_mostly_far(keep)) {
      // Another store than the one that was looked for, and whose key is this job's now.
      job_.stores->give_up(store::PackKind::splats, key(keep));
      keep.near.clear();
      if (auto found = find(keep)) return found;
    }
    *cached = false;
    prepare();
    return build_gaussian_store(job_,
                                {&source_, key(keep), request_.path, facts(), keep, request_.fades,
                                 scene_->info().are_points, request_.run_splats, request_.fan_in});
  }

 private:
  static std::unique_ptr<io::SplatScene> open(job::JobContext& job,
                                              const planning::SplatRequest& request) {
    const runtime::Lease lease(job.budget, io::kOpenSplatBytes, "opening " + request.path);
    return io::open_splat_scene(request.path, request.axes, [&job] { job.meter.advance(0); });
  }

  store::SplatFacts facts() const {
    const io::SplatSceneInfo& info = scene_->info();
    return {info.splats, info.model, source_.lobes(), info.is_linear};
  }

  std::unique_ptr<store::SplatStore> find(const gaussian::SplatKeep& keep) {
    return find_store(
        job_, store::PackKind::splats, key(keep), [&](std::unique_ptr<store::PackReader> pack) {
          return std::make_unique<store::SplatStore>(std::move(pack), facts(), job_.compressor());
        });
  }

  Hash128 key(const gaussian::SplatKeep& keep) {
    Hasher hash;
    hash.add(std::string_view("splats"));
    hash.add(store::kFormatVersion);
    hash.add(kGaussianStoreVersion);
    for (const std::string& path : scene_->info().files) {
      if (!job_.stores->persistent()) {    // nobody will look for it: spare the second reading of a
        hash.add(std::string_view(path));  // file of many GB
        continue;
      }
      const Hash128 content = file_hash(job_, path);
      hash.add(content);
    }
    // What shapes the Gaussians while they are read, and which of them are kept. How they are
    // blended later is no part of the store.
    hash.add(to_text(request_.axes));
    hash.add(source_.lobes());
    keep.add_to(hash);
    if (request_.fades != gaussian::FadeIsolated::of_all_scenes) {
      hash.add(std::string_view("isolated"));
      hash.add(request_.fades);
    }
    return hash.digest();
  }

  void prepare() {
    if (is_prepared_) return;
    const runtime::Lease lease(job_.budget, scene_->prepare_bytes(), "unpacking " + request_.path);
    scene_->prepare(job_.scratch_place(), [this] { job_.meter.advance(0); });
    is_prepared_ = true;
  }

  bool is_mostly_far(const gaussian::SplatKeep& keep) {
    prepare();
    const runtime::Lease lease(
        job_.budget,
        round_to_pages(std::min(count(), io::kSampleSplats) * sizeof(store::Splat)) +
            source_.read_bytes(),
        "scanning " + request_.path);
    const PageVector<store::Splat> sample = source_.sample();
    const auto near = static_cast<std::size_t>(
        std::count_if(sample.begin(), sample.end(), [&](const store::Splat& splat) {
          return keep.filter(splat) != store::SplatFilter::out_of_reach;
        }));
    return near > 0 && near * kWorthLeavingOut <= sample.size();
  }

  job::JobContext& job_;
  const planning::SplatRequest& request_;
  const std::unique_ptr<io::SplatScene> scene_;
  const SceneGaussians source_;
  bool is_prepared_ = false;
};

}  // namespace

std::unique_ptr<store::SplatStore> splat_store(job::JobContext& job,
                                               const planning::SplatRequest& request, bool* cached,
                                               double progress_end) {
  SceneStore scene(job, request);
  job.meter.begin("precondition", 2 * scene.count(), "Gaussians", progress_end);
  auto store = scene.make(cached);
  job.meter.end();
  report_filtered(job, *store);
  return store;
}

planning::SceneFacts scene_facts(const planning::SplatRequest& request,
                                 const std::function<void()>& poll) {
  const auto scene = io::open_splat_scene(request.path, request.axes, poll);
  const io::SplatSceneInfo& info = scene->info();
  if (info.are_points && request.keep.max_sigma) {
    throw Error(ErrorKind::usage, "--max-scale: the points of a cloud have no size; " +
                                      request.path + " is a point cloud, remove the option");
  }
  planning::SceneFacts facts{
      info.splats, kept_lobes(info, request), info.is_linear, info.files, info.assumptions,
      0,           scene->unpacked_bytes(),   info.origin};
  facts.least_bytes =
      std::max(scene->prepare_bytes(),
               gaussian_store_least_bytes(info.splats, scene->read_bytes(), facts.lobes));
  return facts;
}

}  // namespace pounce::flow
