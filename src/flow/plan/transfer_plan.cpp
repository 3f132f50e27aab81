// SPDX-License-Identifier: Apache-2.0
//
// All that is decided before any work, so that whatever is wrong is said before it: the source,
// then each target, then what all of it needs of memory and disk. Several targets are read one
// after the other here, and again when their turn comes: only one of their meshes is in memory.
#include "flow/plan/transfer_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include "flow/build/splats.h"
#include "flow/describe_job.h"
#include "flow/job.h"
#include "flow/load_mesh.h"
#include "flow/plan/left_behind.h"
#include "flow/plan/output_names.h"
#include "io/read_mesh.h"
#include "mesh/tangent_space.h"
#include "projection/mesh_fit.h"

namespace pounce::flow {
namespace {

/// A model output is planned as its images.
TransferOptions image_options(TransferOptions options) {
  if (io::is_model_path(options.output)) options.output = model_image_pattern(options.output);
  return options;
}

}  // namespace

bool PlannedTarget::has_work(const std::vector<std::size_t>& channels, std::size_t page) const {
  return std::any_of(channels.begin(), channels.end(),
                     [&](std::size_t c) { return !plan.images[c][page].keep; });
}

bool PlannedTarget::has_work() const {
  for (const auto& images : plan.images) {
    for (const ImageOutput& image : images) {
      if (!image.keep) return true;
    }
  }
  return false;
}

void PlannedTarget::drop_mesh() {
  mesh = {};
  mesh_lease = {};
}

TransferPlan::TransferPlan(JobContext& job, const TransferOptions& options,
                           std::uint32_t stripe_rows)
    : job_(job),
      options_(image_options(options)),
      model_pattern_(io::is_model_path(options.output) ? options.output : ""),
      stripe_rows_(stripe_rows),
      job_hash_(job, options_) {}

void TransferPlan::make(double end) {
  const StageTimer timer(job_.clock, "read");
  job_.meter.begin("read meshes", 1 + options_.targets.size(), "meshes", end);
  DiskPlan disk(job_.keeps_stores, job_.cache_limit_bytes);
  plan_source_side(disk);
  for (const std::string& path : options_.targets) plan_target_side(path, disk);
  if (source_plan_.from_splats) {  // with the last target's mesh beside, and one without anything
    need(source_plan_.scene.least_bytes + contexts() + target_.mesh.size_bytes() +
             source_.size_bytes(),
         "sorting " + options_.source);
  }
  job_.meter.end();
  job_.report.disk_most = disk.forecast();
  job_.report.disk_most->scratch_limit_bytes = job_.scratch_limit_bytes;
  add_note(scratch_note(*job_.report.disk_most));
  check_all_outputs(options_, source_plan_, outputs_, inputs_);
  if (job_.plan_only) job_.report.outputs = outputs_;
  require_least(job_, least_,
                source_.size_bytes() + target_.mesh.size_bytes() + source_plan_.table_bytes);
  source_lease_ = runtime::Lease(job_.budget, source_.size_bytes(), "the source's mesh");
  target_.mesh_lease = runtime::Lease(job_.budget, target_.mesh.size_bytes(), "the target's mesh");
  compressors_lease_ = runtime::Lease(job_.budget, contexts(), "the compressors");
  tables_lease_ = runtime::Lease(job_.budget, source_plan_.table_bytes, "the tables of --ocio");
  if (options_.targets.size() == 1 && !job_.plan_only) name_jobs();
}

void TransferPlan::plan_source_side(DiskPlan& disk) {
  if (is_splat_scene(options_.source)) {
    source_plan_ =
        plan_splats(options_, !model_pattern_.empty(), [this] { job_.meter.advance(0); });
    source_files_ = source_plan_.scene.files;
    disk.add_splats(source_plan_.scene.splats, source_plan_.scene.lobes,
                    source_plan_.scene.unpacked_bytes);
    job_.report.notes = source_plan_.scene.assumptions;
    job_.meter.advance(1);
  } else {
    refuse_splat_options(options_);
    read_source();
    check_order();
    source_plan_ = plan_source(options_, source_, !model_pattern_.empty());
    source_plan_.origin = origin_;
    source_plan_.places = target::strew(source_, projection::kSourcePlaces);
    for (const ChannelPlan& channel : source_plan_.channels) {
      if (channel.channel == Channel::position)
        add_note(positions_note(origin_, channel.format.depth));
    }
    if (source_plan_.tangents) {
      need_tangents(source_, 0);
      add_tangents(*source_plan_.tangents, source_);
    }
    if (source_plan_.as_gaussians) {
      job_.report.sigma_texels = source_plan_.sigma_texels;
      job_.report.densify = source_plan_.densify;
    } else {
      job_.report.filter = filter_name(source_plan_.filter);
    }
    disk.add_source(source_plan_);
    add_note(not_transferred(options_, source_plan_, source_));
    if (model_pattern_.empty()) add_note(factors_note(options_, source_plan_, source_));
  }
  if (source_plan_.table_loading_bytes > 0) {
    need(source_plan_.table_loading_bytes + source_.size_bytes(),
         "the tables of " + options_.colour.config);
  }
  check_channel_outputs();
  add_warnings(source_plan_.warnings);
  if (!source_plan_.passes.empty())
    add_warning(coarse_positions(source_, origin_, source_plan_.passes.front().size));
  for (const std::string& note : source_plan_.notes) job_.report.notes.push_back(note);
  add_inputs(source_files_);
  for (const ColumnPlan& column : source_plan_.columns) add_input(column.image.path, job_.report);
}

void TransferPlan::plan_target_side(const std::string& path, DiskPlan& disk) {
  target_.mesh = {};  // the one before, whose memory this one takes
  target_.mesh = read_target(path, source_.size_bytes());
  if (source_plan_.makes_normals()) {
    need_tangents(target_.mesh, source_.size_bytes());
    add_tangents(target_tangents(options_, target_.mesh), target_.mesh);
  }
  plan_one(path);
  const TargetPlan& plan = target_.plan;
  for (const PassPlan& pass : source_plan_.passes) {
    const std::uint64_t texels = std::uint64_t{pass.size.width} * pass.size.height;
    least_target_texels_ = std::min(least_target_texels_, texels * plan.pages.size());
  }
  disk.add_target(source_plan_, plan, target_.mesh, target_.model.has_value());
  warn_of_own_colours();
  if (source_plan_.from_splats) keep_near(options_, plan, target_.mesh, source_plan_.splats);
  add_warnings(plan.warnings);
  if (!source_plan_.passes.empty() && path != options_.source)
    add_warning(coarse_positions(target_.mesh, origin_, source_plan_.passes.front().size));
  add_inputs(target_.mesh.files);
  add_inputs(plan.inputs);
  for (const auto& images : plan.images) {  // what is painted over in place is read, too
    for (const ImageOutput& image : images)
      add_input(image.onto ? image.onto->path : "", job_.report);
  }
  outputs_.insert(outputs_.end(), plan.outputs.begin(), plan.outputs.end());
  inputs_.insert(inputs_.end(), plan.inputs.begin(), plan.inputs.end());
  job_.report.kept.insert(job_.report.kept.end(), plan.kept.begin(), plan.kept.end());
  anything_to_write_ = anything_to_write_ || target_.has_work();
  need_target(path);
}

/// An output of its own is no wish for a channel: it may be meant for another job.
void TransferPlan::check_channel_outputs() const {
  for (const ChannelOutput& own : options_.image.channel_outputs) {
    const bool is_made =
        std::any_of(source_plan_.channels.begin(), source_plan_.channels.end(),
                    [&](const ChannelPlan& plan) { return plan.channel == own.channel; });
    if (is_made) continue;
    const std::string name = channel_name(options_, own.channel);
    throw Error(
        ErrorKind::usage,
        fmt::format("--output-for {}={}: this job makes no {}; name it in --channels{}, or "
                    "leave this out",
                    name, own.path, name,
                    is_shape(own.channel) || own.channel == Channel::normal ? " or --bake" : ""));
  }
}

void TransferPlan::need(std::uint64_t bytes, const std::string& why) {
  const std::uint64_t with_tables = bytes + source_plan_.table_bytes;
  if (with_tables > least_.bytes) least_ = {with_tables, why};
}

void TransferPlan::need_tangents(const mesh::Mesh& mesh, std::uint64_t beside) {
  need(beside + mesh.size_bytes() + mesh::tangents_bytes(mesh), "the tangents of " + mesh.path);
  require_early(job_, least_, beside + mesh.size_bytes());
}

void TransferPlan::need_target(const std::string& path) {
  const LeastMemory one = least_memory(source_plan_, target_.plan, source_, target_.mesh,
                                       job_.threads, job_.tile_cap_bytes);
  need(one.bytes, one.why);
  if (target_.model)
    need(target_.model->least_bytes() + contexts(), "writing " + target_.model->path());
  need(std::max(source_plan_.from_splats ? 0 : reading_bytes(options_.source),
                source_.size_bytes() + reading_bytes(path)),
       "reading " + options_.source + " and " + path);
  if (options_.targets.size() == 1) return;
  // Again when its turn comes, beside the stores of the source.
  std::uint64_t directories = 0;
  for (const PassPlan& pass : source_plan_.passes) {
    directories += source_plan_.from_splats
                       ? 64 << 10
                       : geometry_directory_bytes(pass.source, job_.tile_cap_bytes);
  }
  const std::uint64_t tangents =
      source_plan_.makes_normals() ? target_.mesh.size_bytes() + mesh::tangents_bytes(target_.mesh)
                                   : 0;
  need(contexts() + directories + std::max(reading_bytes(path), tangents), "reading " + path);
}

void TransferPlan::drop_source_mesh() {
  source_ = {};
  source_lease_ = {};
}

PlannedTarget& TransferPlan::target(std::size_t t) {
  if (options_.targets.size() > 1) {
    const StageTimer timer(job_.clock, "read");
    target_ = {};
    const std::string& path = options_.targets[t];
    {
      const runtime::Lease reading(job_.budget, reading_bytes(path), "reading " + path);
      target_.mesh = load_target(path);
    }
    if (source_plan_.makes_normals()) {
      const runtime::Lease tangents(job_.budget,
                                    target_.mesh.size_bytes() + mesh::tangents_bytes(target_.mesh),
                                    "the tangents of " + path);
      add_tangents(target_tangents(options_, target_.mesh), target_.mesh);
    }
    target_.mesh_lease =
        runtime::Lease(job_.budget, target_.mesh.size_bytes(), "the target's mesh");
    plan_one(options_.targets[t]);
    for (const std::string& file : target_.plan.kept) {  // some may have been made meanwhile
      std::vector<std::string>& kept = job_.report.kept;
      if (std::find(kept.begin(), kept.end(), file) == kept.end()) kept.push_back(file);
    }
    name_jobs();
  }
  return target_;
}

/// A model keeps its vertices as they are.
void TransferPlan::warn_of_own_colours() {
  const auto& channels = source_plan_.channels;
  const bool has_base = std::any_of(channels.begin(), channels.end(), [](const ChannelPlan& c) {
    return c.channel == Channel::base_color;
  });
  if (!target_.model || !target_.mesh.has_vertex_colours || !has_base) return;
  add_warnings(
      {fmt::format("{}: its vertices have colours, which stay in the model: renderers "
                   "multiply the new baseColor by them; remove them if that is not meant",
                   target_.plan.path)});
}

/// What shows that source and target are in the wrong order is said before what is missing.
void TransferPlan::check_order() {
  const bool needs_none = !options_.material.textures.empty() || !options_.channels.baked.empty();
  if (needs_none || has_textures(source_) || !source_.colours.empty()) return;
  for (const std::string& path : options_.targets) {
    require_early(job_, {source_.size_bytes() + reading_bytes(path), "reading " + path},
                  source_.size_bytes());
    refuse_swapped(source_, load_target(path));
  }
}

/// What follows sees the mesh as if the file had these tangents.
void TransferPlan::add_tangents(const TangentPlan& tangents, mesh::Mesh& mesh) {
  mesh::set_tangents(mesh, tangents.uv_sets, tangents.keeps_own);
}

void TransferPlan::plan_one(const std::string& path) {
  target_.plan = plan_target(options_, source_plan_, path, target_.mesh);
  for (auto& images : target_.plan.images) {
    for (ImageOutput& image : images) image.stripe_rows = stripe_rows_;
  }
  if (!model_pattern_.empty()) {
    target_.model.emplace(model_pattern_, source_plan_, options_.allow_external, target_.plan);
  }
  // A job that finds damage begins again; what is painted over in place must be painted once.
  for (const auto& images : target_.plan.images) {
    for (const ImageOutput& image : images)
      job_.check_packs = job_.check_packs || (image.onto && image.onto->in_place);
  }
  if (options_.skip_existing) keep_what_is_there();
}

/// Reads every input, so not before it is known that the job can be done; --skip-existing must.
void TransferPlan::name_jobs() {
  TargetPlan& plan = target_.plan;
  for (std::size_t c = 0; c < plan.images.size(); ++c) {
    for (std::size_t page = 0; page < plan.images[c].size(); ++page) {
      plan.images[c][page].job =
          job_hash_.of_image(source_files_, source_plan_, target_.mesh.files, plan, c, page);
    }
  }
  if (target_.model) target_.model->set_job(job_hash_.of_model(target_.model->path(), plan));
}

void TransferPlan::warn_of_kept() {
  const std::vector<std::string>& kept = target_.plan.kept_by_time;
  if (kept.empty()) return;
  target_.plan.warnings.push_back(fmt::format(
      "{}{}: kept because younger than all inputs; which job made it is not recorded there",
      kept.front(), kept.size() > 1 ? fmt::format(" and {} more", kept.size() - 1) : ""));
}

void TransferPlan::keep_what_is_there() {
  name_jobs();
  std::vector<std::string> meshes = target_.mesh.files;
  meshes.insert(meshes.end(), source_files_.begin(), source_files_.end());
  if (!target_.model) {
    keep_existing(source_plan_, newest(meshes), job_.run.written_before, target_.plan);
    return warn_of_kept();
  }
  // A model is made of all its inputs, the images that it takes over among them.
  for (const ColumnPlan& column : source_plan_.columns) meshes.push_back(column.image.path);
  meshes.insert(meshes.end(), target_.plan.inputs.begin(), target_.plan.inputs.end());
  if (!keeps_model(newest(meshes))) return;
  warn_of_kept();
  for (auto& images : target_.plan.images) {
    for (ImageOutput& image : images) image.keep = true;
  }
  target_.plan.kept = std::exchange(target_.plan.outputs, {});
}

/// The model says which job made it; of the files beside it, its images and masks say their own.
bool TransferPlan::keeps_model(FileTime inputs) {
  TargetPlan& plan = target_.plan;
  std::map<std::string, std::string> jobs{{target_.model->path(), target_.model->job()}};
  for (const auto& images : plan.images) {
    for (const ImageOutput& image : images) {
      jobs[image.path] = image.job;
      jobs[image.coverage_path] = image.job;
    }
  }
  std::vector<std::string> by_time;
  for (const std::string& output : plan.outputs) {
    if (job_.run.written_before.count(output) > 0) return false;
    const auto job = jobs.find(output);
    const bool keeps = job == jobs.end()  // a buffer or an image that was copied
                           ? has_content(output)
                           : keeps_all({output}, job->second, inputs, by_time);
    if (!keeps) return false;
  }
  plan.kept_by_time = by_time;
  return true;
}

std::uint64_t TransferPlan::contexts() const {
  return job_.threads * store::Compressor::context_bytes();
}

void TransferPlan::read_source() {
  const std::string& path = options_.source;
  require_early(job_, {reading_bytes(path), "reading " + path}, 0);
  PlacedMesh placed = place_mesh(path, options_.source_use, "source", options_.allow_external);
  source_ = std::move(placed.mesh);
  source_files_ = source_.files;
  origin_ = placed.origin;
  job_.report.origin = {origin_.x, origin_.y, origin_.z};
  add_warnings(source_.warnings);
  for (const std::string& note : source_.notes) add_note(note);
  add_note(origin_note(path, origin_));
  job_.meter.advance(1);
}

mesh::Mesh TransferPlan::read_target(const std::string& path, std::uint64_t beside) {
  require_early(job_, {beside + reading_bytes(path), "reading " + path}, beside);
  mesh::Mesh mesh = load_target(path);
  add_warnings(mesh.warnings);
  job_.meter.advance(1);
  return mesh;
}

std::uint64_t TransferPlan::reading_bytes(const std::string& path) const {
  return io::mesh_cost(path, {options_.allow_external, {}, true}, job_.budget.limit()).peak_bytes;
}

mesh::Mesh TransferPlan::load_target(const std::string& path) const {
  return load_mesh(path, options_.target_use, "target", options_.allow_external, origin_,
                   !options_.composite.onto.empty());
}

void TransferPlan::add_warning(const std::string& warning) {
  if (!warning.empty()) job_.report.warnings.push_back(warning);
}

void TransferPlan::add_warnings(const std::vector<std::string>& warnings) {
  job_.report.warnings.insert(job_.report.warnings.end(), warnings.begin(), warnings.end());
}

void TransferPlan::add_note(const std::string& note) {
  if (!note.empty()) job_.report.notes.push_back(note);
}

void TransferPlan::add_inputs(const std::vector<std::string>& files) {
  for (const std::string& file : files) add_input(file, job_.report);
}

}  // namespace pounce::flow
