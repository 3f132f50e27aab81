// SPDX-License-Identifier: Apache-2.0
//
// One target, page by page:
//
//   mesh ─▶ vectorize ─▶ target store ─▶ project ─▶ results ─▶ write ─▶ images
//                                           ▲
//                                      source stores
//
// A page is written before the next one begins. Its images then wait for the disk beside the next
// pages (write/pending_outputs.h): what is there when a job is stopped is whole.
//
// With --skip-existing several jobs may be at the same outputs, and share them: each claims what it
// makes next, looks whether it was made meanwhile, and leaves for later what another has claimed.
//
// A claim is held for one step, until its images are on the disk, or for a whole model, and nobody
// waits for a claim while holding one. So two jobs on the same outputs cannot wait for each other
// (docs/decisions/039-output-claims.md).
//
// The target's mesh stays until its last page is vectorized, but projecting and writing a page read
// its blocks only. Scratch packs of results belong to a step: the next step's replaces them.
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "core/hash.h"
#include "flow/project/results.h"
#include "flow/stores/build_stores.h"
#include "flow/transfer_plan.h"
#include "job/output_claim.h"
#include "job/part_files.h"
#include "outcome/clipped_samples.h"
#include "outcome/target_tally.h"
#include "planning/half_done.h"
#include "planning/others_outputs.h"
#include "projection/mesh_fit.h"
#include "runtime/shared_work.h"
#include "surface/strewn_places.h"

namespace pounce::flow {
namespace {

// Shares of the progress bar, measured on a 4096² transfer of a head with a PNG in and out.
constexpr double kVectorizeShare = 0.06, kProjectShare = 0.66;  // of a page
constexpr double kViewsShare = 0.4;  // of a target, where a scene is drawn from all around

std::vector<planning::Step> steps_to_make(const planning::SourcePlan& source,
                                          const planning::TargetPlan& target) {
  std::vector<planning::Step> steps;
  for (std::uint32_t page = 0; page < target.pages.size(); ++page) {
    for (std::size_t p = 0; p < source.passes.size(); ++p) {
      if (planning::has_work(target, source.passes[p].channels, page)) steps.push_back({p, page});
    }
  }
  return steps;
}

class TargetTransfer {
 public:
  TargetTransfer(job::JobContext& job, const planning::OutputPolicy& policy, const Source& source,
                 PlannedTarget& target, PendingOutputs& pending, ProgressRange range)
      : job_(job),
        policy_(policy),
        source_plan_(source.plan()),
        source_(source),
        target_(target),
        pending_(pending),
        range_(range),
        others_(job, policy, source_plan_, target.plan, model_of(target)) {}

  bool run(OthersWork others) {
    // The order matters. What may end this visit without a trace comes first: nothing is counted or
    // reported of a target that is left for later.
    std::vector<Step> steps = steps_to_make(source_plan_, target_.plan);
    if (policy_.skips_existing && others == OthersWork::leave && !steps.empty() &&
        !others_.is_any_free(steps))
      return false;
    if (policy_.skips_existing && target_.model && !steps.empty()) {
      pending_.wait();
      claim_of_model_ = others_.await_model();
      // Another job may have finished the model between planning and this claim.
      if (others_.keep_made_model()) steps.clear();
    }
    tally_.emplace(policy_.min_coverage_percent, source_facts(), target_.plan,
                   target_.model ? target_.model->path() : "", job_.report);
    if (steps.empty()) {
      job_.meter.keep(range_.end);
      return true;
    }
    // All of these need the mesh, which goes while pages are made.
    const double area = surface::surface_area(target_.mesh);
    if (policy_.role != TaskRole::assemble) look_around(area);
    if (policy_.role == TaskRole::prepare) return prepare(steps);
    find_occupied();
    places_ = surface::strew(target_.mesh, source_.target_places());
    make(std::move(steps));
    // A model comes last, and whether a target has enough is known when its images are there.
    if (target_.model || policy_.min_coverage_percent > 0) pending_.wait();
    tally_->spreads(area);
    clipped_.warn(source_plan_, job_.report);
    if (target_.model && !is_shared() && !is_missing_) write_model();
    if (tally_->is_in_question()) {
      const StageTimer timer(job_.clock, "project");
      if (!mesh_fit_) find_mesh_fit();
      if (finding_fit_ != nullptr) finding_fit_->wait();
      tally_->fits(*mesh_fit_);
    }
    // Of parts nobody knows what their images lack.
    if (is_missing_ || makes_parts_) return true;
    tally_->layers(source_.layer_gaps());
    tally_->finish(source_.box());
    return true;
  }

 private:
  using Step = planning::Step;

  static planning::ModelFile model_of(const PlannedTarget& target) {
    if (!target.model) return {};
    return {target.model->path(), target.model->job()};
  }

  outcome::SourceFacts source_facts() const {
    return {&source_plan_, source_.box_name(), source_.cure(), !source_.places().empty(),
            source_.own_target().has_value()};
  }

  bool has_work(const Step& step) const {
    return planning::has_work(target_.plan, source_plan_.passes[step.pass].channels, step.page);
  }

  bool is_shared() const { return policy_.role == TaskRole::share; }

  /// Of this step; null: one run makes all of everything.
  const planning::StepShare* share_of(const Step& step) const {
    return target_.plan.shares.empty() ? nullptr : &target_.plan.shares[step.pass][step.page];
  }

  void look_around(double area) {
    const double end = range_.begin + kViewsShare * (range_.end - range_.begin);
    views_ = source_.views_of(target_.plan, target_.mesh, area, {range_.begin, end});
    if (views_ != nullptr) range_.begin = end;
  }

  /// The stores that others will read.
  bool prepare(const std::vector<Step>& steps) {
    steps_done_ = steps_of_all() - steps.size();
    for (const Step& step : steps) {
      vectorize(step.pass, step.page);
      ++steps_done_;
      job_.meter.keep(fraction(0));
    }
    return true;
  }

  /// Each image is written as soon as nothing of it is missing, and memory and scratch files are of
  /// one step. What others have claimed comes last, when it is there or theirs no more.
  void make(std::vector<Step> steps) {
    steps_done_ = steps_of_all() - steps.size();
    job_.meter.keep(fraction(0));
    // A round tries all steps once. Those that others have claimed are tried again in the next
    // round, and only a round that could claim nothing waits.
    while (!steps.empty()) {
      std::vector<Step> others;
      for (std::size_t i = 0; i < steps.size(); ++i) {
        const std::optional<job::OutputClaim> claim = others_.claim(steps[i]);
        if (!claim) {
          others.push_back(steps[i]);
          continue;
        }
        job_.waiting.reset();
        job_.meter.resume();
        for (const std::size_t c : others_.keep_made(steps[i])) tally_->keeps(c, steps[i].page);
        // The mesh goes with the last step only if no step is left to other jobs: one that fails or
        // is killed leaves its steps to this one.
        const bool is_last = i + 1 == steps.size() && others.empty();
        if (has_work(steps[i]))
          make_images(steps[i], is_last, claim_of_model_ ? claim_of_model_ : claim);
        ++steps_done_;
        job_.meter.keep(fraction(0));  // what of its share took no work
      }
      if (others.size() == steps.size()) wait_for_others();
      steps = std::move(others);
    }
  }

  /// Holding no claim: images that could not get their names would keep theirs.
  void wait_for_others() {
    pending_.wait();
    others_.wait();
  }

  // --- what this one makes -----------------------------------------------------------------------

  bool pads() const {
    const auto any = [](const std::vector<planning::ImageOutput>& images) {
      return std::any_of(images.begin(), images.end(),
                         [](const planning::ImageOutput& image) { return image.padding > 0; });
    };
    return std::any_of(target_.plan.images.begin(), target_.plan.images.end(), any);
  }

  /// What padding must leave alone when it is painted over old images.
  void find_occupied() {
    if (!target_.plan.painted_over || !pads()) return;
    const std::uint64_t triangles = target_.mesh.triangles.size() + target_.mesh.rest.size();
    occupied_lease_ = runtime::Lease(job_.budget, triangles * planning::kOccupiedBytes,
                                     "the target's triangles on its images");
    const auto pages = planning::occupied_pages(target_.mesh, target_.plan.pages,
                                                target_.plan.by_tile, target_.plan.uv_set);
    std::uint64_t bytes = 0;
    for (const auto& page : pages) bytes += page->size_bytes();
    if (bytes > occupied_lease_.bytes()) {  // some stand in several periods of UV space
      occupied_lease_ = {};
      occupied_lease_ = runtime::Lease(job_.budget, bytes, "the target's triangles on its images");
    }
    for (auto& images : target_.plan.images) {
      for (std::size_t p = 0; p < pages.size(); ++p) images[p].onto->occupied = pages[p];
    }
  }

  void make_images(const Step& step, bool is_last, std::optional<job::OutputClaim> claim) {
    const auto [p, page] = step;
    pending_.begin_step();
    if (policy_.role == TaskRole::assemble) {
      if (job::PartFiles(job_, results_key(step)).is_empty()) return;
      if (!share_of(step)->in_parts) return miss(step, 0, 0, share_of(step)->tasks);
    }
    // A cache that a thousand tasks fill is looked through by each of them, again and again: they
    // add what others read. Nobody has all hits, or all results, of an image that is cut.
    job_.keeps_pages = !is_shared();
    job_.stores->add_new(store::PackKind::hits, job_.keeps_pages);
    job_.stores->add_new(store::PackKind::geometry, !is_shared() || share_of(step)->in_parts);
    const auto target = vectorize(p, page);
    const runtime::Lease directory(job_.budget, target->size_bytes(),
                                   "the directory of the target store");
    is_last_ = is_last;
    if (is_last) target_.drop_mesh();  // from here on only stores are read, never the inputs
    const std::uint64_t read_before = source_.bytes_read(p);
    claim_ = std::move(claim);
    transfer_page(p, page, *target);
    claim_.reset();
    job_.report.tiles_read += target->directory().tiles.size();
    job_.report.bytes_read += source_.bytes_read(p) - read_before + target->pack().bytes_read();
  }

  std::unique_ptr<store::GeometryStore> vectorize(std::size_t p, std::uint32_t page) {
    const StageTimer timer(job_.clock, "vectorize");
    job_.meter.begin(page_title("vectorize", page), 0, "tiles", fraction(kVectorizeShare));
    bool cached = false;
    auto target = made_ahead({p, page}, &cached);
    if (target == nullptr) target = geometry_store(job_, target_.plan.requests[p][page], &cached);
    all_targets_cached_ = all_targets_cached_ && cached;
    if (all_targets_cached_) job_.clock.set_cached("vectorize");
    job_.report.target_tiles += target->directory().tiles.size();
    job_.report.target_store_bytes += target->pack().size_bytes();
    job_.count_store(target->pack(), cached);
    tally_->vectorized(page, target->directory());
    job_.meter.end(cached);
    return target;
  }

  /// What was made beside the source's images; null: nothing.
  std::unique_ptr<store::GeometryStore> made_ahead(const Step& step, bool* cached) {
    if (!target_.ahead || target_.ahead->step != step) return nullptr;
    VectorizedPage page = std::move(*target_.ahead);
    target_.ahead.reset();
    *cached = page.cached;
    return std::move(page.store);
  }

  void transfer_page(std::size_t p, std::uint32_t page, const store::GeometryStore& target) {
    const std::uint64_t texels = target.directory().texels;
    // Without texels a UDIM tile gets no file and a model's material stays as it is. A single image
    // is written even if it is empty: its user has named it.
    if (texels == 0 && target_.plan.by_tile) return leave_empty({p, page});
    if (texels == 0 && target_.model) return tally_->add_page(p, page, 0, nullptr);
    const planning::StepShare* share = share_of({p, page});
    const bool in_parts = share != nullptr && share->in_parts;
    ResultCollector results(job_, target, source_plan_.passes[p].channels.size(),
                            results_key({p, page}),
                            {policy_.role, policy_.task, in_parts ? share : nullptr});
    try {
      if (in_parts && is_shared()) return make_part({p, page}, target, results);
      if (in_parts && results.texels_left() > 0)
        return miss({p, page}, texels - results.texels_left(), texels, results.missing_tasks());
      make_page(p, page, target, results);
    } catch (const Error& e) {
      // What a later run would go on with may be made from what is damaged.
      if (e.kind() == ErrorKind::damaged_store) results.forget();
      throw;
    }
    auto pack = results.release();
    // A model's images are only there once it is.
    if (!target_.model) return pending_.end_step(std::move(pack));
    if (pack != nullptr) packs_of_model_.push_back(std::move(pack));
  }

  Hash128 results_key(const Step& step) const {
    return planning::results_key(source_plan_, source_plan_.passes[step.pass], target_.plan,
                                 step.page);
  }

  /// Of an image that is assembled later.
  void make_part(const Step& step, const store::GeometryStore& target, ResultCollector& results) {
    makes_parts_ = true;
    const std::uint64_t texels = results.texels_left();
    const PageResult result = project_page(step.pass, step.page, target, results);
    tally_->add_page(step.pass, step.page, source_.texels_of(result, texels), &result);
  }

  /// No image will say that it was made.
  void leave_empty(const Step& step) {
    if (policy_.role != TaskRole::whole && !job_.parts_folder.empty())
      job::PartFiles(job_, results_key(step)).note_empty();
  }

  /// An image cannot be assembled.
  void miss(const Step& step, std::uint64_t texels, std::uint64_t of_texels,
            const std::vector<std::uint32_t>& tasks) {
    for (const std::string& path : planning::images_to_make(source_plan_, target_.plan, step))
      job_.report.missing.push_back(
          {target_.model ? target_.model->path() : path, texels, of_texels, tasks});
    is_missing_ = true;
  }

  void make_page(std::size_t p, std::uint32_t page, const store::GeometryStore& target,
                 ResultCollector& results) {
    const std::uint64_t texels = target.directory().texels;
    const PageResult result = project_page(p, page, target, results);
    tally_->add_page(p, page, source_.texels_of(result, texels), &result);
    if (is_last_ && tally_->is_in_question()) find_mesh_fit();  // while its images are written
    const bool may_stay_empty =
        target_.model || (target_.plan.by_tile && !target_.plan.painted_over);
    const bool found = std::any_of(result.covered.begin(), result.covered.end(),
                                   [](std::uint64_t covered) { return covered > 0; });
    if (found || !may_stay_empty) return write_page(p, page, result, results);
    leave_empty({p, page});
  }

  /// By another thread, where there is one: in the same time many threads make many texels.
  void find_mesh_fit() {
    mesh_fit_.emplace();
    finding_fit_ = runtime::begin_work([this] {
      mesh_fit_ = projection::fit_of(places_, source_.places(), target_.plan.diagonal);
    });
  }

  /// Where the progress bar stands when this share of the page and pass at hand is done. All pages
  /// and passes count alike: how many texels a page has is known when it is vectorized.
  double fraction(double share) const {
    const auto steps = static_cast<double>(steps_of_all());
    return range_.begin +
           (range_.end - range_.begin) * (static_cast<double>(steps_done_) + share) / steps;
  }

  std::size_t steps_of_all() const {
    return source_plan_.passes.size() * target_.plan.pages.size();
  }

  PageResult project_page(std::size_t p, std::uint32_t page, const store::GeometryStore& target,
                          ResultCollector& results) {
    const StageTimer timer(job_.clock, "project");
    begin_projecting(p, page, target.directory().texels, results);
    // Once for all pages: coverage depends on the fit, so it must not depend on the page or on
    // --tiles.
    if (!fit_) {
      fit_ = source_.fit(places_, target_.plan);
      if (fit_) tally_->fits(*fit_);
    }
    PageResult result = source_
                            .projector(p, page, target, target_.plan,
                                       {fit_.value_or(projection::SplatFit{}), views_.get()})
                            ->project(results);
    job_.report.bytes_written += result.written_bytes;
    outcome::add_nodes(result.nodes, job_.report.nodes);
    job_.meter.end(result.is_known);
    return result;
  }

  /// What an earlier run has made takes no work: its share of the progress is there at once.
  void begin_projecting(std::size_t p, std::uint32_t page, std::uint64_t texels,
                        const ResultCollector& results) {
    const auto share = [&](std::uint64_t part) {
      return static_cast<double>(part) / static_cast<double>(texels);
    };
    if (!is_shared() && !results.makes_all())
      job_.meter.keep(
          fraction(kVectorizeShare + share(texels - results.texels_left()) * kProjectShare));
    if (results.went_on_with() > 0) {
      job_.note(
          fmt::format("{}: went on from an earlier run, which had made {:.0f} % of its texels",
                      planning::images_to_make(source_plan_, target_.plan, {p, page}).front(),
                      100 * share(results.went_on_with())));
    }
    job_.meter.begin(page_title("project", page), results.texels_left(), "texels",
                     fraction(kVectorizeShare + kProjectShare));
  }

  std::string page_title(const std::string& stage, std::uint32_t page) const {
    return target_.plan.by_tile ? fmt::format("{} {}", stage, target_.plan.pages[page].udim)
                                : stage;
  }

  void write_page(std::size_t p, std::uint32_t page, const PageResult& result,
                  ResultCollector& results) {
    const planning::PassPlan& pass = source_plan_.passes[p];
    const StageTimer timer(job_.clock, "assemble");
    job_.meter.begin(page_title("write", page), pass.channels.size() * pass.size.height, "rows",
                     fraction(1));
    for (std::size_t i = 0; i < pass.channels.size(); ++i) {
      const std::size_t c = pass.channels[i];
      const planning::ImageOutput& image = target_.plan.images[c][page];
      if (image.keep) continue;
      const runtime::Lease index(job_.budget, result.blocks[i].size() * sizeof(store::ChunkRef),
                                 "the index of the results");
      const bool in_place = image.onto && image.onto->in_place && !image.painted;
      const auto number = static_cast<std::uint32_t>(i);
      const auto colours = results.encodings(2 * number),
                 coverage = results.encodings(2 * number + 1);
      WrittenImage file = write_image(job_, image, source_plan_.channels[c].format, *result.pack,
                                      result.blocks[i], {colours.get(), coverage.get()},
                                      target_.model ? &target_.model->sink(job_) : nullptr);
      const WrittenTexels& written = file.texels;
      tally_->wrote(c, written.filled);
      clipped_.count(c, (written.any_fresh ? result.clipped[i] : 0) + written.clipped, image.path);
      if (target_.model) target_.model->add(c, page, written);
      pending_.add({std::move(file.files), claim_, in_place});
    }
    job_.report.bytes_read += result.pack->bytes_read();
    tally_->wrote_page(page);
    job_.meter.end();
  }

  void write_model() {
    const StageTimer timer(job_.clock, "model");
    const std::vector<std::string> files = target_.model->write(job_);
    job_.report.outputs.insert(job_.report.outputs.end(), files.begin(), files.end());
    for (const auto& pack : packs_of_model_) pack->forget();
    packs_of_model_.clear();
    tally_->wrote_model();
  }

  job::JobContext& job_;
  const planning::OutputPolicy policy_;
  const planning::SourcePlan& source_plan_;
  const Source& source_;
  PlannedTarget& target_;
  PendingOutputs& pending_;
  std::optional<job::OutputClaim> claim_of_model_, claim_;  ///< of the step at hand
  ProgressRange range_;                        ///< what is left of it once views are there
  std::optional<outcome::TargetTally> tally_;  ///< once something is made or kept
  planning::OthersOutputs others_;
  outcome::ClippedSamples clipped_;
  runtime::Lease occupied_lease_;
  std::vector<surface::Place> places_;       ///< of the target: where the fit is found
  std::unique_ptr<SceneViews> views_;        ///< of a splat scene that is seen from all around
  std::optional<projection::SplatFit> fit_;  ///< of a splat scene, once the first page is projected
  /// What the finished steps of a model have made, until it is there.
  std::vector<std::unique_ptr<job::StepPack>> packs_of_model_;
  std::optional<projection::MeshFit> mesh_fit_;  ///< of the target: once it is looked for
  std::unique_ptr<BegunWork> finding_fit_;       ///< writes it; before what it reads goes
  bool all_targets_cached_ = true;
  bool is_last_ = false;          ///< the step at hand: nothing is projected after it
  bool is_missing_ = false;       ///< some image could not be assembled
  bool makes_parts_ = false;      ///< of images that others assemble
  std::uint64_t steps_done_ = 0;  ///< passes of pages
};

}  // namespace

BesideImages vectorizing_ahead(job::JobContext& job, const planning::OutputPolicy& policy,
                               const planning::SourcePlan& source, PlannedTarget& target) {
  // What is there already, or in work elsewhere, shows when it is claimed.
  if (policy.skips_existing || policy.role != TaskRole::whole) return {};
  const std::vector<planning::Step> steps = steps_to_make(source, target.plan);
  if (steps.empty()) return {};
  const planning::Step step = steps.front();
  const surface::GeometryRequest& request = target.plan.requests[step.pass][step.page];
  const auto make = [&job, &target, step, &request] {
    VectorizedPage page{step, nullptr, false};
    page.store = geometry_store(job, request, &page.cached);
    target.ahead = std::move(page);
  };
  return {make, surface::geometry_least_bytes(request, job.tile_cap_bytes) +
                    surface::geometry_directory_bytes(request, job.tile_cap_bytes)};
}

bool transfer_to(job::JobContext& job, const planning::OutputPolicy& policy, const Source& source,
                 PlannedTarget& target, PendingOutputs& pending, ProgressRange range,
                 OthersWork others) {
  return TargetTransfer(job, policy, source, target, pending, range).run(others);
}

}  // namespace pounce::flow
