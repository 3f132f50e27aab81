// SPDX-License-Identifier: Apache-2.0
//
// A mesh is made of a source, and a texture for it:
//
//   source ─▶ surface ─▶ simplified ─▶ charts ─▶ .glb ─▶ a transfer of the source onto it
//
// A proxy of a scene is the mesh alone. A model's appearance is in its textures, so a lighter model
// has them, too. The mesh between the two steps is a file without a name.
#include "pounce/proxy.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/nameless_file.h"
#include "flow/shape/model.h"
#include "flow/shape/own_uvs.h"
#include "flow/shape/scene.h"
#include "flow/shape/write.h"
#include "flow/transfer.h"
#include "io/files/output_file.h"
#include "io/model/model_writer.h"
#include "job/run_job.h"
#include "mesh/block_bins.h"
#include "options/table.h"
#include "planning/describe_job.h"
#include "planning/load_mesh.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"
#include "pounce/textured_mesh.h"

namespace pounce {
namespace flow {
namespace {

// Shares of the progress bar.
constexpr double kAfterSurface = 0.7;  // of the mesh
constexpr double kAfterMesh = 0.5;     // where a transfer follows

void make_mesh(job::JobContext& job, const TransferOptions& source, bool is_scene,
               const MeshShape& shape, double end,
               const std::function<std::uint64_t(const io::PlainMesh&)>& write) {
  const double part = kAfterSurface * end;
  SourceSurface surface = is_scene ? surface_of_scene(job, source, shape, part)
                                   : surface_of_model(job, source, shape, part);
  write_shape(job, std::move(surface), shape, end, write);
}

// --- the mesh alone ------------------------------------------------------------------------------

void check_proxy(const ProxyOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.source.empty() || o.output.empty()) usage("a source and an output are required");
  if (!io::is_glb_path(o.output)) usage(o.output + ": a proxy is written as .glb; name it so");
  options::check_ranges(o);
  planning::axes_of(planning::as_transfer(o).source_use, "source");
}

void make_proxy(job::JobContext& job, const ProxyOptions& options) {
  planning::check_outputs({options.output});
  TransferOptions source = planning::as_transfer(options);
  source.splats.harmonics = SphericalHarmonics::dc;  // depths are the same with all
  make_mesh(job, source, true, options.shape, 1,
            [&](const io::PlainMesh& mesh) { return io::write_glb(options.output, mesh); });
  job.report.outputs = {options.output};
}

// --- with what it looks like ---------------------------------------------------------------------

/// The transfer onto a mesh that is named so.
TransferOptions onto(const std::string& mesh, const TexturedMeshOptions& options, bool is_scene) {
  TransferOptions transfer = options.transfer;
  transfer.targets = {mesh};
  transfer.image.size = ImageSize{options.shape.size, options.shape.size};
  // A lighter mesh has lost the shape that its normal map can show.
  const std::vector<Channel>& wanted = transfer.channels.transferred;
  const bool all = wanted.empty() || transfer.channels.all;
  const bool wants_normal =
      all || std::find(wanted.begin(), wanted.end(), Channel::normal) != wanted.end();
  if (!is_scene && wants_normal) {
    std::erase(transfer.channels.transferred, Channel::normal);
    // No name would mean all channels.
    if (!all && transfer.channels.transferred.empty())
      transfer.channels.transferred = {Channel::normal};
    transfer.channels.baked = {Channel::normal};
  }
  return transfer;
}

/// What is wrong whatever the source is.
void check_textured(const TexturedMeshOptions& options) {
  const TransferOptions& o = options.transfer;
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.source.empty() || o.output.empty()) usage("a source and an output are required");
  if (!o.targets.empty()) usage(o.targets.front() + ": the target is made here; remove it");
  if (!io::is_model_path(o.output))
    usage(o.output + ": a textured mesh is written as .glb or .gltf; name it so");
  if (planning::has_token(o.output, "TARGET"))
    usage(o.output + ": there is no target but the mesh that is made; remove <TARGET>");
  planning::expand_pattern(planning::model_image_pattern(o.output),
                           {{"MATERIAL", ""}, {"CHANNEL", ""}});
  options::check_ranges(options);
  planning::axes_of(o.source_use, "source");
}

void check_textured(const TexturedMeshOptions& options, bool is_scene) {
  // What the transfer would refuse of the options, before the mesh is made.
  const TransferOptions transfer = onto(options.transfer.output, options, is_scene);
  planning::check_options(transfer);
  if (is_scene) {
    planning::refuse_mesh_options(transfer);
    options::refuse_unsuitable(options, options::Source::splats);
  } else {
    planning::refuse_splat_options(transfer);
    options::refuse_unsuitable(options, options::Source::mesh);
  }
}

/// The text with the output's name where the path of the mesh is.
std::string renamed(std::string text, const std::string& path, const std::string& name) {
  for (std::size_t at = 0; (at = text.find(path, at)) != std::string::npos; at += name.size())
    text.replace(at, path.size(), name);
  return text;
}

/// Nobody knows the path of the mesh in between: what is said of it is said of the output.
void rename(Report& report, const std::string& path, const std::string& name) {
  std::erase(report.inputs, path);
  for (TargetReport& target : report.targets) target.path = renamed(target.path, path, name);
  for (std::string& text : report.warnings) text = renamed(text, path, name);
  for (std::string& text : report.notes) text = renamed(text, path, name);
  report.least_memory_for = renamed(report.least_memory_for, path, name);
}

void make_textured(job::JobContext& job, const TexturedMeshOptions& options, bool is_scene) {
  const std::string& name = options.transfer.output;
  planning::check_outputs({name});
  NamelessFile file(job.scratch_folder);
  const auto write = [&](const io::PlainMesh& mesh) {
    const std::uint64_t bytes = io::write_glb(file.stream(), name, mesh);
    file.flush();
    return bytes;
  };
  const TransferOptions transfer = onto(file.path(), options, is_scene);
  job.merges_materials = !options.shape.keep_uvs;
  if (options.shape.keep_uvs) {
    write_with_own_uvs(job, transfer, options.shape, kAfterMesh, write);
  } else {
    make_mesh(job, transfer, is_scene, options.shape, kAfterMesh, write);
  }
  const job::LeastMemory least{job.report.least_memory_bytes, job.report.least_memory_for};
  job.meter.restart();
  try {
    transfer_in(job, transfer);
  } catch (const Error& e) {
    rename(job.report, file.path(), name);
    throw Error(e.kind(), renamed(e.what(), file.path(), name), e.is_passing());
  }
  rename(job.report, file.path(), name);
  if (least.bytes <= job.report.least_memory_bytes) return;
  job.report.least_memory_bytes = least.bytes;
  job.report.least_memory_for = least.why;
}

void run_textured(const TexturedMeshOptions& options, bool is_scene, job::JobRun& run,
                  bool rebuild) {
  check_textured(options, is_scene);
  const TransferOptions& transfer = options.transfer;
  const auto job = job::open_job(transfer.resources, transfer.output, nullptr, rebuild, false, run);
  job->tile_cap_bytes = mesh::kTileCapBytes;
  make_textured(*job, options, is_scene);
}

}  // namespace
}  // namespace flow

Report proxy(const ProxyOptions& options, Progress* progress, Report* so_far) {
  return job::run_job(options.resources, progress, so_far, [&](job::JobRun& run, bool rebuild) {
    planning::describe(options, run.report);
    flow::check_proxy(options);
    if (!planning::is_splat_scene(options.source)) {
      options::refuse_unsuitable(options, options::Source::mesh);
      return flow::run_textured({planning::as_transfer(options), options.shape}, false, run,
                                rebuild);
    }
    options::refuse_unsuitable(options, options::Source::splats);
    const auto job = job::open_job(options.resources, options.output, nullptr, rebuild, false, run);
    flow::make_proxy(*job, options);
  });
}

Report textured_mesh(const TexturedMeshOptions& options, Progress* progress, Report* so_far) {
  const Resources& resources = options.transfer.resources;
  return job::run_job(resources, progress, so_far, [&](job::JobRun& run, bool rebuild) {
    planning::describe(options, run.report);
    flow::check_textured(options);
    flow::run_textured(options, planning::is_splat_scene(options.transfer.source), run, rebuild);
  });
}

}  // namespace pounce
