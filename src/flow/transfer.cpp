// SPDX-License-Identifier: Apache-2.0
//
// The whole job, as a list of stages. Start here.
//
//   source mesh ─▶ precondition ─▶ source store ─┐ join
//                                                ├─▶ grid ─▶ project ─▶ results ─▶ pad ─▶ images
//   target mesh ─▶ vectorize ────▶ target store ─┘
//
// Stages are functions from values to values; threads, memory and files are wired here and in this
// folder.
#include "pounce/transfer.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <thread>

#include "core/system_memory.h"
#include "flow/job.h"
#include "flow/output_names.h"
#include "flow/plan.h"
#include "io/read_mesh.h"

namespace pounce {
namespace flow {
namespace {

// Shares of the progress bar, measured on a 4096² transfer of a head with a PNG in and out.
constexpr double kAfterReading = 0.02, kAfterSource = 0.2, kAfterTarget = 0.25;
constexpr double kProjectShare = 0.7;  // of a pass; the rest writes its images

/// A mesh whose reading takes no more than this is read even if the budget is smaller, to say
/// exactly how much the job needs.
constexpr std::uint64_t kReadAnyway = 64ULL << 20;

/// The stores that one pass joins.
struct PassStores {
  std::unique_ptr<tiles::GeometryStore> source, target;
};

class TransferJob {
 public:
  TransferJob(const TransferOptions& options, Progress* progress, bool rebuild)
      : options_(options),
        job_(open_job(options.resources, options.output, options.internal.in_core, rebuild,
                      options.plan_only, progress)) {
    job_->tile_cap_bytes =
        options.internal.tile_cap_bytes != 0 ? options.internal.tile_cap_bytes : kTileCapBytes;
    kernels_ = &projection::kernels(options.internal.isa);
  }

  Report run() {
    job_->report.command = "transfer";
    job_->report.isa = kernels_->isa;
    read_meshes();
    plan_ = make_plan(options_, source_, target_);
    check_budget();
    // From here on it is known what will be done and that it fits.
    job_->report.warnings.insert(job_->report.warnings.end(), plan_.warnings.begin(),
                                 plan_.warnings.end());
    job_->report.outputs = plan_.outputs;
    if (options_.plan_only) return finish_report(*job_);
    precondition_colours();
    precondition_source();
    vectorize_target();
    free_meshes();
    // From here on only the stores are read, never the inputs.
    for (std::size_t p = 0; p < plan_.passes.size(); ++p) {
      const ProjectResult result = project_pass(p);
      write_pass(p, result);
    }
    return finish_report(*job_);
  }

 private:
  void read_meshes() {
    const StageTimer timer(job_->clock, "read");
    const std::uint64_t reading = std::max(io::mesh_cost(options_.source).peak_bytes,
                                           io::mesh_cost(options_.target).peak_bytes);
    if (reading > std::max(job_->budget.limit(), kReadAnyway)) {
      // Too large to look inside and say more exactly what the rest needs.
      require_least(*job_, {io::mesh_cost(options_.source).peak_bytes +
                                io::mesh_cost(options_.target).peak_bytes + kReadAnyway,
                            "reading " + options_.source + " and " + options_.target});
    }
    job_->meter.begin("read meshes", 2, "meshes", kAfterReading);
    source_ = io::read_mesh(options_.source);
    job_->meter.advance(1);
    target_ = io::read_mesh(options_.target);
    job_->meter.advance(1);
    job_->meter.end();
    for (const mesh::Mesh* mesh : {&source_, &target_}) {
      job_->report.warnings.insert(job_->report.warnings.end(), mesh->warnings.begin(),
                                   mesh->warnings.end());
    }
  }

  void check_budget() {
    LeastMemory least = least_memory(plan_, source_, target_, job_->threads, job_->tile_cap_bytes);
    const std::uint64_t reading =
        std::max(io::mesh_cost(options_.source).peak_bytes,
                 source_.size_bytes() + io::mesh_cost(options_.target).peak_bytes);
    if (reading > least.bytes)
      least = {reading, "reading " + options_.source + " and " + options_.target};
    require_least(*job_, least);
    mesh_lease_ = Lease(job_->budget, source_.size_bytes() + target_.size_bytes(), "the meshes");
    store_leases_.emplace_back(job_->budget, job_->threads * tiles::Compressor::context_bytes(),
                               "the compressors");
  }

  void precondition_colours() {
    const StageTimer timer(job_->clock, "precondition");
    std::uint64_t rows = 0;
    for (const ColumnPlan& column : plan_.columns) rows += (column.info.height + 63) / 64;
    job_->meter.begin("source colours", rows, "rows of tiles", (kAfterReading + kAfterSource) / 2);
    for (const ColumnPlan& column : plan_.columns) {
      bool cached = false;
      columns_.push_back(
          colour_store(*job_, {&column.image, column.wrap_u, column.wrap_v}, &cached));
      all_cached_ = all_cached_ && cached;
      const tiles::ColourDirectory& image = columns_.back()->directory();
      if (image.nonfinite > 0) {
        job_->report.source_filtered["nonfinite samples"] += image.nonfinite;
        job_->report.warnings.push_back(
            fmt::format("{}: {} samples are NaN or infinite and count as 0", column.image.label,
                        image.nonfinite));
      }
      job_->report.bytes_written += cached ? 0 : columns_.back()->pack().size_bytes();
      job_->report.source_store_bytes += columns_.back()->pack().size_bytes();
    }
    job_->meter.end();
  }

  void precondition_source() {
    const StageTimer timer(job_->clock, "precondition");
    job_->meter.begin("precondition", 0, "tiles", kAfterSource);
    for (const PassPlan& pass : plan_.passes) {
      bool cached = false;
      stores_.push_back({geometry_store(*job_, pass.source, &cached), nullptr});
      all_cached_ = all_cached_ && cached;
      const tiles::GeometryStore& store = *stores_.back().source;
      const tiles::GeometryDirectory& directory = store.directory();
      job_->report.source_gaussians = std::max(job_->report.source_gaussians, directory.texels);
      job_->report.source_tiles += directory.tiles.size();
      job_->report.bytes_written += cached ? 0 : store.pack().size_bytes();
      store_leases_.emplace_back(job_->budget, store.size_bytes(),
                                 "the directory of the source store");
      job_->report.source_store_bytes += store.pack().size_bytes();
      if (directory.degenerate > 0)
        job_->report.source_filtered["degenerate triangles"] = directory.degenerate;
      if (directory.slivers > 0)
        job_->report.source_filtered["triangles without a texel centre"] = directory.slivers;
    }
    if (all_cached_) job_->clock.set_cached("precondition");
    job_->meter.end();
  }

  void vectorize_target() {
    const StageTimer timer(job_->clock, "vectorize");
    job_->meter.begin("vectorize", 0, "tiles", kAfterTarget);
    bool all_cached = true;
    for (std::size_t p = 0; p < plan_.passes.size(); ++p) {
      bool cached = false;
      stores_[p].target = geometry_store(*job_, plan_.passes[p].target, &cached);
      all_cached = all_cached && cached;
      const tiles::GeometryStore& store = *stores_[p].target;
      job_->report.target_tiles += store.directory().tiles.size();
      store_leases_.emplace_back(job_->budget, store.size_bytes(),
                                 "the directory of the target store");
      job_->report.target_store_bytes += store.pack().size_bytes();
      job_->report.bytes_written += cached ? 0 : store.pack().size_bytes();
      if (p == 0) {  // counts are those of the first channel
        job_->report.target_texels = store.directory().texels;
        job_->report.target_overlapping = store.directory().overlapping;
      }
      if (store.directory().overlapping > 0 && p == 0) {
        job_->report.warnings.push_back(
            fmt::format("{}: {} texels are claimed by more than one triangle; the first in "
                        "file order has them",
                        options_.target, store.directory().overlapping));
      }
    }
    if (all_cached) job_->clock.set_cached("vectorize");
    job_->meter.end();
  }

  void free_meshes() {
    source_ = {};
    target_ = {};
    mesh_lease_ = {};
  }

  /// Where the progress bar stands when `part` of pass p is done.
  double pass_fraction(std::size_t p, double part) const {
    const double passes = static_cast<double>(plan_.passes.size());
    return kAfterTarget + (1 - kAfterTarget) * (static_cast<double>(p) + part) / passes;
  }

  ProjectResult project_pass(std::size_t p) {
    const StageTimer timer(job_->clock, "project");
    const PassPlan& pass = plan_.passes[p];
    job_->meter.begin("project", stores_[p].target->directory().texels, "texels",
                      pass_fraction(p, kProjectShare));
    ProjectRequest request;
    request.source = stores_[p].source.get();
    request.target = stores_[p].target.get();
    request.kernels = kernels_;
    request.limits.max_distance = plan_.max_distance;
    request.limits.min_cosine =
        static_cast<float>(std::cos(options_.max_angle_deg * std::numbers::pi / 180));
    request.smallest_edge = plan_.smallest_edge;
    for (const std::size_t c : pass.channels) {
      const ChannelPlan& channel = plan_.channels[c];
      ChannelOutput output{channel.format, {}};
      for (std::size_t m = 0; m < channel.page_column.size(); ++m) {
        const int column = channel.page_column[m];
        output.pages.push_back(
            {column < 0 ? nullptr : columns_[static_cast<std::size_t>(column)].get(),
             channel.page_constant[m]});
      }
      request.channels.push_back(std::move(output));
    }
    ProjectResult result = project(*job_, request);
    const std::uint64_t texels = stores_[p].target->directory().texels;
    if (p == 0) {  // counts are those of the first channel
      job_->report.target_covered = result.covered;
      job_->report.target_empty = texels - result.covered;
      if (result.covered == 0) warn_of_nothing(stores_[p]);
    }
    job_->report.tiles_read += stores_[p].target->directory().tiles.size();
    job_->report.bytes_read +=
        stores_[p].source->pack().bytes_read() + stores_[p].target->pack().bytes_read();
    job_->report.bytes_written += result.pack->size_bytes();
    job_->meter.end();
    return result;
  }

  /// A result without a single covered texel is hardly what was wanted: say what may be wrong.
  void warn_of_nothing(const PassStores& stores) {
    const auto text = [](const Box3f& b) {
      return fmt::format("({:g} {:g} {:g})..({:g} {:g} {:g})", b.lo.x, b.lo.y, b.lo.z, b.hi.x,
                         b.hi.y, b.hi.z);
    };
    const tiles::GeometryDirectory& target = stores.target->directory();
    if (target.texels == 0) {
      job_->report.warnings.push_back(options_.target +
                                      ": its UVs cover no texel centre; the result is empty");
      return;
    }
    job_->report.warnings.push_back(
        fmt::format("no texel found a source within {:g}: the result is empty. The source spans "
                    "{}, the target {}; align "
                    "them, or raise --max-distance or --max-angle",
                    plan_.max_distance, text(stores.source->directory().box), text(target.box)));
  }

  void write_pass(std::size_t p, const ProjectResult& result) {
    const PassPlan& pass = plan_.passes[p];
    const StageTimer timer(job_->clock, "assemble");
    std::uint64_t rows = 0;
    for (const std::size_t c : pass.channels) {
      for (const ImageOutput& image : plan_.channels[c].images) rows += image.lattice.height;
    }
    job_->meter.begin("write", rows, "rows", pass_fraction(p, 1));
    for (std::size_t i = 0; i < pass.channels.size(); ++i) {
      const ChannelPlan& channel = plan_.channels[pass.channels[i]];
      for (std::size_t page = 0; page < channel.images.size(); ++page) {
        const Lease index(job_->budget,
                          result.channels[i].pages[page].size() * sizeof(tiles::ChunkRef),
                          "the index of the results");
        const std::uint64_t filled = write_image(*job_, channel.images[page], channel.format,
                                                 *result.pack, result.channels[i].pages[page]);
        if (pass.channels[i] == 0) job_->report.target_filled += filled;
      }
    }
    job_->report.bytes_read += result.pack->bytes_read();
    job_->meter.end();
  }

  const TransferOptions& options_;
  std::unique_ptr<JobContext> job_;
  const projection::Kernels* kernels_ = nullptr;
  mesh::Mesh source_, target_;
  Plan plan_;
  Lease mesh_lease_;
  std::vector<Lease> store_leases_;  ///< what stays in use until the job ends
  std::vector<std::unique_ptr<tiles::ColourStore>> columns_;
  std::vector<PassStores> stores_;
  bool all_cached_ = true;
};

void check_options(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.source.empty() || o.target.empty() || o.output.empty())
    usage("a source, a target and an output are needed");
  if (!(o.max_distance.value > 0) || !std::isfinite(o.max_distance.value))
    usage("--max-distance must be above 0");
  if (!(o.max_angle_deg >= 0 && o.max_angle_deg < 90))
    usage("--max-angle must be at least 0 and below 90 degrees");
  if (o.all_channels && !o.channels.empty()) usage("--channels takes either a list or all");
  if (o.size && (o.size->width == 0 || o.size->height == 0)) usage("--size must be at least 1");
  if (o.padding_px && *o.padding_px > 65536) usage("--padding must be at most 65536");
  for (const char* token : {"UDIM", "UVTILE"}) {
    if (has_token(o.output, token))
      usage(o.output + ": <" + token + "> is not supported yet; name one image");
  }
}

}  // namespace
}  // namespace flow

Report transfer(const TransferOptions& options, Progress* progress) {
  flow::check_options(options);
  return flow::run_job(options.resources, [&](bool rebuild) {
    return flow::TransferJob(options, progress, rebuild).run();
  });
}

}  // namespace pounce
