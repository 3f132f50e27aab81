// SPDX-License-Identifier: Apache-2.0
//
// All that is decided before any work, so that whatever is wrong is said before it: the source,
// then each target, then what all of it needs of memory and disk. (The first target's mesh may be
// read while the source is: early_mesh.h.) Several targets are read one
// after the other here, and again when their turn comes: only one of their meshes is in memory.
//
// The source decides channels, sizes and passes, a target decides pages and names. Needs of memory
// are collected as (bytes, reason), one for each step of the job, with what is held beside that
// step; the largest one is the least budget that works (job::MemoryNeeds). A step that is missing
// here is not noticed while planning: it ends a job in its middle, at small budgets only.
//
// Planning has costs of its own. Before a mesh is read, require_early() refuses what is hopeless.
#include "flow/transfer_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/system_limits.h"
#include "io/read_mesh.h"
#include "job/run_job.h"
#include "job/step_pack.h"
#include "mesh/tangent_space.h"
#include "planning/describe_job.h"
#include "planning/existing_outputs.h"
#include "planning/half_done.h"
#include "planning/known_map.h"
#include "planning/load_mesh.h"
#include "planning/name_patterns.h"

namespace pounce::flow {
namespace {

/// What is planned. A model output is planned as its images, a map as the transfer that made it.
TransferOptions planned_options(TransferOptions options) {
  if (io::is_model_path(options.output))
    options.output = planning::model_image_pattern(options.output);
  if (planning::is_hit_map(options.source))
    return planning::apply_options(planning::read_known_map(options.source, options.trust),
                                   options);
  return options;
}

}  // namespace

bool PlannedTarget::has_work() const {
  for (const auto& images : plan.images) {
    for (const planning::ImageOutput& image : images) {
      if (!image.keep) return true;
    }
  }
  return false;
}

void PlannedTarget::drop_mesh() {
  mesh = {};
  mesh_lease = {};
}

TransferPlan::TransferPlan(job::JobContext& job, const TransferOptions& options,
                           const job::TestKnobs& knobs)
    : job_(job),
      options_(planned_options(options)),
      model_pattern_(io::is_model_path(options.output) ? options.output : ""),
      knobs_(knobs),
      job_hash_(job, options_),
      needs_(job) {}

planning::OutputPolicy TransferPlan::policy() const {
  return {options_.skip_existing, options_.resources.wait_for_cache, options_.min_coverage_percent,
          options_.share.role, options_.share.task};
}

void TransferPlan::make(double end) {
  const StageTimer timer(job_.clock, "read");
  job_.meter.begin("read meshes", 1 + options_.targets.size(), "meshes", end);
  planning::DiskPlan disk(job_.keeps_stores, job_.cache_limit_bytes);
  source_ = open_source(job_, options_, !model_pattern_.empty(), knobs_);
  read_early();
  source_->make_plan(needs_, disk, [this](const mesh::Mesh& mesh) { check_order(mesh); });
  plan_source();
  // The source first: channels and sizes of the outputs follow from it, and so do requests and
  // names of the targets.
  for (std::size_t t = 0; t < options_.targets.size(); ++t) plan_target_side(t, disk);
  // The source's stores are built while the target that was planned last is in memory.
  const std::uint64_t meshes = source_->held_bytes() + target_.mesh.size_bytes();
  for (const job::LeastMemory& step : source_->build_needs())
    needs_.add(contexts() + meshes + step.bytes, step.why);
  job_.meter.end();
  job_.report.disk_most = disk.forecast();
  job_.report.disk_most->scratch_limit_bytes = job_.scratch_limit_bytes;
  job_.spare_scratch_bytes = disk.spare_bytes(job_.scratch_limit_bytes);
  // What tasks leave for each other is not only this job's.
  if (options_.share.role == TaskRole::whole)
    job_.plain_room =
        disk.plain_bytes(job_.scratch_limit_bytes, largest_file_bytes(), job_.budget.limit());
  job_.note(planning::scratch_note(*job_.report.disk_most));
  // All targets together, since two of them may produce one name.
  planning::check_all_outputs(options_, source_->plan(), outputs_, inputs_);
  if (job_.plan_only) {
    job_.report.outputs = outputs_;
    job_.report.work_s = planning::work_seconds(units_, options_, source_->plan());
  }
  const std::uint64_t tables = source_->plan().table_bytes;
  require_least(job_, needs_.most(), meshes + tables);
  source_->lease_held();
  target_.mesh_lease = runtime::Lease(job_.budget, target_.mesh.size_bytes(), "the target's mesh");
  compressors_lease_ = runtime::Lease(job_.budget, contexts(), "the compressors");
  tables_lease_ = runtime::Lease(job_.budget, tables, "the tables of --ocio");
  // Naming reads every input. Of several targets each is named when its turn comes.
  if (options_.targets.size() == 1 && !job_.plan_only) name_jobs();
}

/// What planning a source of any kind says.
void TransferPlan::plan_source() {
  const planning::SourcePlan& plan = source_->plan();
  if (plan.table_loading_bytes > 0) {
    needs_.add(plan.table_loading_bytes + source_->held_bytes(),
               "the tables of " + options_.colour.config);
  }
  planning::check_channel_outputs(options_, plan);
  for (const std::string& warning : plan.warnings) job_.warn(warning);
  for (const std::string& note : plan.notes) job_.note(note);
  add_inputs(source_->files());
  inputs_.insert(inputs_.end(), source_->files().begin(), source_->files().end());
  for (const planning::ColumnPlan& column : plan.columns)
    planning::add_input(column.image.path, job_.report);
}

void TransferPlan::plan_target_side(std::size_t t, planning::DiskPlan& disk) {
  const std::string& path = options_.targets[t];
  const planning::SourcePlan& source = source_->plan();
  target_.mesh = {};  // the one before, whose memory this one takes
  target_.mesh = read_target(path, source_->held_bytes());
  if (source.makes_normals()) {
    const std::uint64_t meshes = source_->held_bytes() + target_.mesh.size_bytes();
    needs_.add_now(meshes + mesh::tangents_bytes(target_.mesh), "the tangents of " + path, meshes);
    add_target_tangents();
  }
  plan_one(t);
  const planning::TargetPlan& plan = target_.plan;
  detail_.add(source, plan);
  disk.add_target(source, plan, target_.mesh, target_.model.has_value(), levels_bytes);
  if (target_.model) job_.warn(planning::own_colours_note(source, target_.mesh));
  source_->meet(plan, target_.mesh);
  for (const std::string& warning : plan.warnings) job_.warn(warning);
  if (path != options_.source)
    job_.warn(planning::coarse_positions(target_.mesh, source.origin, source.passes.front().size));
  add_inputs(target_.mesh.files);
  add_inputs(plan.inputs);
  for (const auto& images : plan.images) {  // what is painted over in place is read, too
    for (const planning::ImageOutput& image : images)
      planning::add_input(image.onto ? image.onto->path : "", job_.report);
  }
  outputs_.insert(outputs_.end(), plan.outputs.begin(), plan.outputs.end());
  inputs_.insert(inputs_.end(), plan.inputs.begin(), plan.inputs.end());
  job_.report.kept.insert(job_.report.kept.end(), plan.kept.begin(), plan.kept.end());
  anything_to_write_ = anything_to_write_ || target_.has_work();
  need_target(path);
  // Naming jobs reads all inputs, so first it is asked whether anything was left at all.
  if (!job_.plan_only || !job::StepPack::any_left(job_)) return;
  name_jobs();
  const auto begun = planning::half_done(job_, source, plan);
  job_.report.half_done.insert(job_.report.half_done.end(), begun.begin(), begun.end());
}

void TransferPlan::need_target(const std::string& path) {
  for (std::size_t p = 0; p < source_->plan().passes.size(); ++p) need_pass(p);
  if (target_.model) {
    needs_.add(target_.model->least_bytes() + contexts(), "writing " + target_.model->path());
  }
  // The source is read alone, a target beside what the source left in memory. (Beside the source it
  // is read where both are little: EarlyMesh.)
  needs_.add(std::max(source_->reading_bytes(), source_->held_bytes() + reading_bytes(path)),
             "reading " + options_.source + " and " + path);
  if (options_.targets.size() == 1) return;
  // Again when its turn comes, beside the stores of the source.
  const std::uint64_t tangents =
      source_->plan().makes_normals()
          ? target_.mesh.size_bytes() + mesh::tangents_bytes(target_.mesh)
          : 0;
  needs_.add(contexts() + source_->directory_bytes() + std::max(reading_bytes(path), tangents),
             "reading " + path);
}

/// What one pass past the target at hand needs, step by step.
void TransferPlan::need_pass(std::size_t p) {
  const planning::SourcePlan& source = source_->plan();
  const planning::PassPlan& pass = source.passes[p];
  const mesh::Mesh& mesh = target_.mesh;
  for (const surface::GeometryRequest& request : target_.plan.requests[p]) {
    needs_.add(contexts() + source_->held_bytes() + mesh.size_bytes() +
                   surface::geometry_least_bytes(request, job_.tile_cap_bytes),
               "vectorizing " + mesh.path);
  }
  // Where the results of one page are, and its pieces; the mesh is there for the next page.
  const std::uint64_t page_blocks = (pass.size.width / 64 + 1ULL) * (pass.size.height / 64 + 1ULL);
  const bool more_pages = source.passes.size() * target_.plan.pages.size() > 1;
  const std::uint64_t beside = contexts() +
                               page_blocks * (sizeof(store::ChunkRef) * pass.channels.size() + 32) +
                               (more_pages ? mesh.size_bytes() : 0);
  // While an image is written all stores stay open.
  std::uint64_t directories = 0;
  for (const surface::GeometryRequest& request : target_.plan.requests[p]) {
    directories =
        std::max(directories, surface::geometry_directory_bytes(request, job_.tile_cap_bytes));
  }
  directories += source_->directory_bytes();
  needs_.add(beside + (2ULL << 20) + source_->project_least_bytes(p),
             "projecting one block of the target");
  for (const std::size_t c : pass.channels) {
    for (const planning::ImageOutput& image : target_.plan.images[c]) {
      const std::uint64_t occupied =
          image.onto && image.padding > 0
              ? (mesh.triangles.size() + mesh.rest.size()) * planning::kOccupiedBytes
              : 0;
      needs_.add(
          beside + directories + occupied + image_least_bytes(image, source.channels[c].format),
          "writing " + image.path);
    }
  }
}

PlannedTarget& TransferPlan::target(std::size_t t) {
  if (options_.targets.size() > 1) {
    // Only one target's mesh is in memory, so it is read and planned again. Its warnings were
    // reported by make(). With --skip-existing more outputs may be up to date by now.
    const StageTimer timer(job_.clock, "read");
    target_ = {};
    const std::string& path = options_.targets[t];
    {
      const runtime::Lease reading(job_.budget, reading_bytes(path), "reading " + path);
      target_.mesh = target_mesh(path);
    }
    if (source_->plan().makes_normals()) {
      const runtime::Lease tangents(job_.budget,
                                    target_.mesh.size_bytes() + mesh::tangents_bytes(target_.mesh),
                                    "the tangents of " + path);
      add_target_tangents();
    }
    target_.mesh_lease =
        runtime::Lease(job_.budget, target_.mesh.size_bytes(), "the target's mesh");
    plan_one(t);
    for (const std::string& file : target_.plan.kept) {  // some may have been made meanwhile
      std::vector<std::string>& kept = job_.report.kept;
      if (std::find(kept.begin(), kept.end(), file) == kept.end()) kept.push_back(file);
    }
    name_jobs();
  }
  return target_;
}

/// What shows that source and target are in the wrong order is said before what is missing.
void TransferPlan::check_order(const mesh::Mesh& source) {
  const bool needs_none = !options_.material.textures.empty() || !options_.channels.baked.empty();
  if (needs_none || planning::has_textures(source) || !source.colours.empty()) return;
  for (const std::string& path : options_.targets) {
    require_early(job_, {source.size_bytes() + reading_bytes(path), "reading " + path},
                  source.size_bytes());
    planning::refuse_swapped(source, target_mesh(path));
  }
}

/// What follows sees the mesh as if the file had these tangents.
void TransferPlan::add_target_tangents() {
  const planning::TangentPlan tangents = planning::target_tangents(options_, target_.mesh);
  mesh::set_tangents(target_.mesh, tangents.uv_sets, tangents.keeps_own);
}

void TransferPlan::plan_one(std::size_t t) {
  target_.plan =
      planning::plan_target(options_, source_->plan(), options_.targets[t], target_.mesh);
  for (auto& images : target_.plan.images) {
    for (planning::ImageOutput& image : images) image.stripe_rows = knobs_.stripe_rows;
  }
  // A model takes its images' names and outputs over, so --skip-existing must look after it.
  if (!model_pattern_.empty()) {
    target_.model.emplace(model_pattern_, source_->plan(), options_.allow_external, target_.plan);
  }
  // A job that finds damage begins again; what is painted over in place must be painted once.
  for (const auto& images : target_.plan.images) {
    for (const planning::ImageOutput& image : images)
      job_.check_packs = job_.check_packs || (image.onto && image.onto->in_place);
  }
  if (first_unit_.size() == t) {
    first_unit_.push_back(units_.size());
    planning::add_units(source_->plan(), target_.plan, target_.model.has_value(), units_);
  }
  // What other tasks make is not looked for: a thousand of them would ask for all images each.
  if (options_.share.role != TaskRole::whole && !share_out(t)) return;
  const std::string model = target_.model ? target_.model->path() : "";
  if (!options_.skip_existing && !planning::may_be_made(options_, target_.plan, model)) return;
  name_jobs();
  std::vector<std::string> meshes = target_.mesh.files;
  meshes.insert(meshes.end(), source_->files().begin(), source_->files().end());
  planning::keep_what_is_there(options_, source_->plan(), meshes,
                               {model, target_.model ? target_.model->job() : ""},
                               job_.run.written_before, target_.plan);
  if (!job_.plan_only) planning::remove_what_is_done(job_, source_->plan(), target_.plan);
}

/// Who makes what is known once all targets are: false, and everything is to be made, until then.
bool TransferPlan::share_out(std::size_t t) {
  if (first_unit_.size() < options_.targets.size()) return false;
  const TaskShare& share = options_.share;
  const auto shares = planning::share_out(units_, share.tasks, !share.folder.empty());
  planning::take_shares(shares, first_unit_[t], share, source_->plan(), target_.plan);
  return true;
}

/// Reads every input, so not before it is known that the job can be done; --skip-existing must.
void TransferPlan::name_jobs() {
  planning::TargetPlan& plan = target_.plan;
  for (std::size_t c = 0; c < plan.images.size(); ++c) {
    for (std::size_t page = 0; page < plan.images[c].size(); ++page) {
      plan.images[c][page].job =
          job_hash_.of_image(source_->files(), source_->plan(), target_.mesh.files, plan, c, page);
    }
  }
  if (target_.model) target_.model->set_job(job_hash_.of_model(target_.model->path(), plan));
}

std::uint64_t TransferPlan::contexts() const {
  return job_.threads * store::Compressor::context_bytes();
}

mesh::Mesh TransferPlan::read_target(const std::string& path, std::uint64_t beside) {
  require_early(job_, {beside + reading_bytes(path), "reading " + path}, beside);
  mesh::Mesh mesh = target_mesh(path);
  for (const std::string& warning : mesh.warnings) job_.warn(warning);
  job_.meter.advance(1);
  return mesh;
}

std::uint64_t TransferPlan::reading_bytes(const std::string& path) const {
  return source_->own_target() ? 0 : reading_bytes(path, job_.budget.limit());
}

/// Refuses what needs more than `most_bytes` before that is known.
std::uint64_t TransferPlan::reading_bytes(const std::string& path, std::uint64_t most_bytes) const {
  return io::mesh_cost(path, {options_.allow_external, {}, true}, most_bytes).peak_bytes;
}

/// The first target's mesh, in the origin that nearly all sources have.
void TransferPlan::read_early() {
  if (planning::is_hit_map(options_.source)) return;
  const std::string& path = options_.targets.front();
  early_.emplace(
      job_, source_->reading_bytes(),
      [this, &path](std::uint64_t most) { return reading_bytes(path, most); },
      [this, &path] { return load_target(path, {}); });
}

mesh::Mesh TransferPlan::load_target(const std::string& path, Vec3d origin) const {
  return planning::load_mesh(path, options_.target_use, "target", options_.allow_external, origin,
                             !options_.composite.onto.empty());
}

mesh::Mesh TransferPlan::target_mesh(const std::string& path) {
  if (auto own = source_->own_target()) return std::move(*own);
  const Vec3d origin = source_->plan().origin;
  if (early_ && path == options_.targets.front()) {
    std::optional<mesh::Mesh> mesh = early_->take();
    early_.reset();
    if (mesh && origin == Vec3d{}) return std::move(*mesh);
  }
  return load_target(path, origin);
}

void TransferPlan::add_inputs(const std::vector<std::string>& files) {
  for (const std::string& file : files) planning::add_input(file, job_.report);
}

}  // namespace pounce::flow
