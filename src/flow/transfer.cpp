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

#include <algorithm>
#include <optional>
#include <utility>

#include "flow/build_splats.h"
#include "flow/check_options.h"
#include "flow/describe_job.h"
#include "flow/existing_outputs.h"
#include "flow/job.h"
#include "flow/left_behind.h"
#include "flow/load_mesh.h"
#include "flow/model_output.h"
#include "flow/output_names.h"
#include "flow/plan.h"
#include "flow/plan_disk.h"
#include "flow/source_stores.h"
#include "flow/target_tally.h"
#include "io/read_mesh.h"

namespace pounce {
namespace flow {
namespace {

// Shares of the progress bar, measured on a 4096² transfer of a head with a PNG in and out.
constexpr double kAfterReading = 0.02, kAfterSource = 0.2;
constexpr double kVectorizeShare = 0.06, kProjectShare = 0.7;  // of a target, of a page

class TransferJob {
 public:
  TransferJob(const TransferOptions& options, JobRun& run, bool rebuild)
      : options_(image_options(options)),
        model_pattern_(io::is_model_path(options.output) ? options.output : ""),
        job_(open_job(options.resources, options.output, options.internal.in_core, rebuild,
                      options.plan_only, run)),
        source_stores_(*job_, options_, plan_) {
    job_->tile_cap_bytes =
        options.internal.tile_cap_bytes != 0 ? options.internal.tile_cap_bytes : kTileCapBytes;
  }

  void run() {
    plan();
    // From here on it is known what will be done and that it fits.
    if (options_.plan_only) return;
    if (options_.skip_existing && !anything_to_write_) return;
    source_stores_.build(kAfterReading, kAfterSource);
    source_ = {};
    source_lease_ = {};
    for (std::size_t t = 0; t < options_.targets.size(); ++t) transfer_to(t);
  }

 private:
  /// A model output is planned as its images.
  static TransferOptions image_options(TransferOptions options) {
    if (io::is_model_path(options.output)) options.output = model_image_pattern(options.output);
    return options;
  }

  // --- the plan ----------------------------------------------------------------------------------

  /// Reads all meshes and decides everything, so that whatever is wrong is said before any work.
  void plan() {
    const StageTimer timer(job_->clock, "read");
    job_->meter.begin("read meshes", 1 + options_.targets.size(), "meshes", kAfterReading);
    LeastMemory least;
    DiskPlan disk(job_->keeps_stores, job_->cache_limit_bytes);
    if (is_splat_scene(options_.source)) {
      plan_ = plan_splats(options_);
      source_files_ = {options_.source};
      least = {
          splat_least_bytes({options_.source, axes_of(options_.source_use, "source")}) + contexts(),
          "sorting " + options_.source};
      disk.add_splats(splat_count({options_.source, axes_of(options_.source_use, "source")}));
      job_->meter.advance(1);
    } else {
      source_ = read(options_.source, 0, false);
      source_files_ = source_.files;
      check_order();
      plan_ = plan_source(options_, source_);
      disk.add_source(plan_);
      add_warnings(left_behind(plan_, source_, !model_pattern_.empty()));
      if (!model_pattern_.empty()) factors_ = model_factors(plan_, source_, plan_.warnings);
    }
    add_warnings(plan_.warnings);
    add_inputs(source_files_);
    for (const ColumnPlan& column : plan_.columns) add_input(column.image.path, job_->report);
    std::vector<std::string> outputs, inputs;
    for (const std::string& path : options_.targets) {
      target_ = {};  // the one before, whose memory this one takes
      target_ = read(path, source_.size_bytes(), true);
      plan_one(path);
      disk.add_target(plan_, target_plan_, target_, model_.has_value());
      add_warnings(target_plan_.warnings);
      add_inputs(target_.files);
      add_inputs(target_plan_.inputs);
      for (const auto& images :
           target_plan_.images) {  // what is painted over in place is read, too
        for (const ImageOutput& image : images)
          add_input(image.onto ? image.onto->path : "", job_->report);
      }
      outputs.insert(outputs.end(), target_plan_.outputs.begin(), target_plan_.outputs.end());
      anything_to_write_ = anything_to_write_ || has_work();
      job_->report.kept.insert(job_->report.kept.end(), target_plan_.kept.begin(),
                               target_plan_.kept.end());
      inputs.insert(inputs.end(), target_plan_.inputs.begin(), target_plan_.inputs.end());
      const LeastMemory one =
          least_memory(plan_, target_plan_, source_, target_, job_->threads, job_->tile_cap_bytes);
      if (one.bytes > least.bytes) least = one;
      if (model_ && model_->least_bytes() + contexts() > least.bytes)
        least = {model_->least_bytes() + contexts(), "writing " + model_->path()};
      const std::uint64_t reading = std::max(plan_.from_splats ? 0 : reading_bytes(options_.source),
                                             source_.size_bytes() + reading_bytes(path));
      if (reading > least.bytes) least = {reading, "reading " + options_.source + " and " + path};
    }
    job_->meter.end();
    job_->report.disk_most = disk.forecast();
    check_all_outputs(options_, plan_, outputs, inputs);
    if (options_.plan_only) job_->report.outputs = outputs;
    require_least(*job_, least);
    source_lease_ = Lease(job_->budget, source_.size_bytes(), "the source's mesh");
    target_lease_ = Lease(job_->budget, target_.size_bytes(), "the target's mesh");
    compressors_lease_ = Lease(job_->budget, contexts(), "the compressors");
  }

  /// What shows that source and target are in the wrong order is said before what is missing.
  void check_order() {
    if (!options_.source_textures.empty() || has_textures(source_)) return;
    for (const std::string& path : options_.targets) {
      require_reading(*job_, source_.size_bytes() + reading_bytes(path), path);
      refuse_swapped(source_, load(path, true));
    }
  }

  void plan_one(const std::string& path) {
    target_plan_ = plan_target(options_, plan_, path, target_);
    if (!model_pattern_.empty()) {
      model_.emplace(model_pattern_, plan_, factors_, options_.allow_external, target_plan_);
    }
    // A job that finds damage begins again; what is painted over in place must be painted once.
    for (const auto& images : target_plan_.images) {
      for (const ImageOutput& image : images)
        job_->check_packs = job_->check_packs || (image.onto && image.onto->in_place);
    }
    if (options_.skip_existing) keep_what_is_there();
  }

  void keep_what_is_there() {
    std::vector<std::string> meshes = target_.files;
    meshes.insert(meshes.end(), source_files_.begin(), source_files_.end());
    if (!model_)
      return keep_existing(plan_, newest(meshes), job_->run.written_before, target_plan_);
    // A model is made of all its inputs, the images that it takes over among them.
    for (const ColumnPlan& column : plan_.columns) meshes.push_back(column.image.path);
    meshes.insert(meshes.end(), target_plan_.inputs.begin(), target_plan_.inputs.end());
    const FileTime inputs = newest(meshes);
    for (const std::string& output : target_plan_.outputs) {
      if (job_->run.written_before.count(output) > 0 || !is_up_to_date(output, inputs)) return;
    }
    for (auto& images : target_plan_.images) {
      for (ImageOutput& image : images) image.keep = true;
    }
    target_plan_.kept = std::exchange(target_plan_.outputs, {});
  }

  /// Is there an image of this page in these channels that has to be written?
  bool has_work(const std::vector<std::size_t>& channels, std::size_t page) const {
    return std::any_of(channels.begin(), channels.end(),
                       [&](std::size_t c) { return !target_plan_.images[c][page].keep; });
  }
  bool has_work() const {
    for (const auto& images : target_plan_.images) {
      for (const ImageOutput& image : images) {
        if (!image.keep) return true;
      }
    }
    return false;
  }

  std::uint64_t contexts() const { return job_->threads * tiles::Compressor::context_bytes(); }

  mesh::Mesh read(const std::string& path, std::uint64_t beside, bool is_target) {
    require_reading(*job_, beside + reading_bytes(path), path);
    mesh::Mesh mesh = load(path, is_target);
    add_warnings(mesh.warnings);
    job_->meter.advance(1);
    return mesh;
  }

  std::uint64_t reading_bytes(const std::string& path) const {
    return io::mesh_cost(path, {options_.allow_external, {}}, job_->budget.limit()).peak_bytes;
  }

  mesh::Mesh load(const std::string& path, bool is_target) const {
    const bool external = options_.allow_external;
    return is_target
               ? load_mesh(path, options_.target_use, "target", external, !options_.onto.empty())
               : load_mesh(path, options_.source_use, "source", external);
  }

  void add_warnings(const std::vector<std::string>& warnings) {
    job_->report.warnings.insert(job_->report.warnings.end(), warnings.begin(), warnings.end());
  }

  void add_inputs(const std::vector<std::string>& files) {
    for (const std::string& file : files) add_input(file, job_->report);
  }

  // --- one target --------------------------------------------------------------------------------

  void transfer_to(std::size_t t) {
    begin_target(t);
    tally_.emplace(options_, plan_, target_plan_, model_ ? model_->path() : "", job_->report);
    if (!has_work()) return;
    vectorize_target();
    // From here on only the stores are read, never the inputs.
    for (std::size_t p = 0; p < plan_.passes.size(); ++p) project_pass(p);
    warn_of_clipped();
    targets_.clear();
    target_leases_.clear();
    if (model_) write_model();
    tally_->finish(source_stores_.box(0));
  }

  void begin_target(std::size_t t) {
    const double share = (1 - kAfterSource) / static_cast<double>(options_.targets.size());
    target_start_ = kAfterSource + share * static_cast<double>(t);
    target_share_ = share;
    if (options_.targets.size() == 1) return;  // as the plan left it
    const StageTimer timer(job_->clock, "read");
    target_ = {};
    target_lease_ = {};
    target_ = load(options_.targets[t], true);
    target_lease_ = Lease(job_->budget, target_.size_bytes(), "the target's mesh");
    plan_one(options_.targets[t]);
  }

  void vectorize_target() {
    const StageTimer timer(job_->clock, "vectorize");
    job_->meter.begin("vectorize", 0, "tiles", target_start_ + target_share_ * kVectorizeShare);
    bool all_cached = true;
    texels_ = done_texels_ = 0;
    for (const GeometryRequest& request : target_plan_.requests) {
      bool cached = false;
      targets_.push_back(geometry_store(*job_, request, &cached));
      all_cached = all_cached && cached;
      const tiles::GeometryStore& store = *targets_.back();
      texels_ += store.directory().texels;
      job_->report.target_tiles += store.directory().tiles.size();
      target_leases_.emplace_back(job_->budget, store.size_bytes(),
                                  "the directory of the target store");
      job_->report.target_store_bytes += store.pack().size_bytes();
      job_->count_store(store.pack(), cached);
    }
    if (all_cached) job_->clock.set_cached("vectorize");
    tally_->vectorized(targets_.front()->directory());
    find_occupied();
    target_ = {};
    target_lease_ = {};
    job_->meter.end();
  }

  /// What padding must leave alone when it is painted over old images.
  void find_occupied() {
    const bool pads = !options_.onto.empty() && options_.padding_px.value_or(1) > 0;
    if (!pads) return;
    const auto pages = occupied_pages(target_, target_plan_.pages, has_tiles(),
                                      options_.target_use.uv_set.value_or(0));
    std::uint64_t bytes = 0;
    for (const auto& page : pages) bytes += page->size_bytes();
    target_leases_.emplace_back(job_->budget, bytes, "the target's triangles on its images");
    for (auto& images : target_plan_.images) {
      for (std::size_t p = 0; p < pages.size(); ++p) images[p].onto->occupied = pages[p];
    }
  }

  /// Page by page, so that each image is written as soon as nothing of it is missing.
  void project_pass(std::size_t p) {
    const tiles::GeometryStore& target = *targets_[p];
    const tiles::PackReader& source = source_stores_.pack(p);
    const std::uint64_t read_before = source.bytes_read();
    {
      const auto projector = source_stores_.projector(p, target, target_plan_);
      for (std::uint32_t page = 0; page < target_plan_.pages.size(); ++page) {
        const std::uint64_t texels = target.directory().page_texels[page];
        if (has_work(plan_.passes[p].channels, page)) transfer_page(p, *projector, page, texels);
        done_texels_ += texels;
      }
    }
    job_->report.tiles_read += target.directory().tiles.size();
    job_->report.bytes_read += source.bytes_read() - read_before + target.pack().bytes_read();
  }

  void transfer_page(std::size_t p, PageProjector& projector, std::uint32_t page,
                     std::uint64_t texels) {
    if (texels == 0 && has_tiles()) return;
    if (texels == 0 && model_) return tally_->add_page(p, page, 0, nullptr);
    const ScratchPack results_go(*job_, tiles::PackKind::results);
    const PageResult result = project_page(projector, page, texels);
    tally_->add_page(p, page, texels, &result);
    const bool may_stay_empty = model_ || (has_tiles() && options_.onto.empty());
    const bool found = std::any_of(result.covered.begin(), result.covered.end(),
                                   [](std::uint64_t covered) { return covered > 0; });
    if (found || !may_stay_empty) write_page(p, page, texels, result);
  }

  /// Does each tile of the target's UVs have an image of its own?
  bool has_tiles() const { return target_plan_.requests.front().tile_pages.has_value(); }

  /// Where the progress bar stands when `texels` of this target's are done.
  double fraction(double texels) const {
    const double done = texels_ == 0 ? 1 : texels / static_cast<double>(texels_);
    return target_start_ + target_share_ * (kVectorizeShare + (1 - kVectorizeShare) * done);
  }

  PageResult project_page(PageProjector& projector, std::uint32_t page, std::uint64_t texels) {
    const StageTimer timer(job_->clock, "project");
    const double done = static_cast<double>(done_texels_);
    job_->meter.begin(page_title("project", page), texels, "texels",
                      fraction(done + kProjectShare * static_cast<double>(texels)));
    PageResult result = projector.project(page);
    job_->report.bytes_written += result.pack->size_bytes();
    job_->meter.end();
    return result;
  }

  std::string page_title(const std::string& stage, std::uint32_t page) const {
    return has_tiles() ? fmt::format("{} {}", stage, target_plan_.pages[page].udim) : stage;
  }

  void write_page(std::size_t p, std::uint32_t page, std::uint64_t texels,
                  const PageResult& result) {
    const PassPlan& pass = plan_.passes[p];
    const StageTimer timer(job_->clock, "assemble");
    job_->meter.begin(page_title("write", page), pass.channels.size() * pass.size.height, "rows",
                      fraction(static_cast<double>(done_texels_ + texels)));
    for (std::size_t i = 0; i < pass.channels.size(); ++i) {
      const std::size_t c = pass.channels[i];
      const ImageOutput& image = target_plan_.images[c][page];
      if (image.keep) continue;
      const Lease index(job_->budget, result.blocks[i].size() * sizeof(tiles::ChunkRef),
                        "the index of the results");
      const bool in_place = image.onto && image.onto->in_place;
      const WrittenTexels written =
          write_image(*job_, image, plan_.channels[c].format, *result.pack, result.blocks[i],
                      model_ ? &model_->sink(*job_) : nullptr);
      job_->run.painted_in_place = job_->run.painted_in_place || in_place;
      tally_->wrote(c, written.filled);
      count_clipped(c, (written.any_fresh ? result.clipped[i] : 0) + written.clipped, image.path);
      if (model_) {
        model_->add(*job_, c, page);
      } else {
        job_->report.outputs.push_back(image.path);
      }
      if (!image.coverage_path.empty()) job_->report.outputs.push_back(image.coverage_path);
    }
    job_->report.bytes_read += result.pack->bytes_read();
    if (has_tiles()) {
      std::vector<int>& udims = job_->report.udims;
      const auto udim = static_cast<int>(target_plan_.pages[page].udim);
      const auto at = std::lower_bound(udims.begin(), udims.end(), udim);
      if (at == udims.end() || *at != udim) udims.insert(at, udim);
    }
    job_->meter.end();
  }

  /// Samples of an image of channel `c` that its depth cannot hold.
  void count_clipped(std::size_t c, std::uint64_t samples, const std::string& path) {
    if (samples == 0) return;
    job_->report.target_clipped += samples;
    clipped_.resize(plan_.channels.size());
    Clipped& clipped = clipped_[c];
    clipped.samples += samples;
    if (clipped.images++ == 0) clipped.first = path;
  }

  /// One warning per channel, however many images it has.
  void warn_of_clipped() {
    for (std::size_t c = 0; c < clipped_.size(); ++c) {
      const Clipped& clipped = clipped_[c];
      if (clipped.samples == 0) continue;
      const Depth depth = plan_.channels[c].format.depth;
      const bool is_half = depth == Depth::half;
      job_->report.warnings.push_back(fmt::format(
          "{}{}: {} samples of {} were clipped: {} holds {}; {} keeps them", clipped.first,
          clipped.images > 1 ? fmt::format(" and {} more", clipped.images - 1) : "",
          clipped.samples, channel_name(plan_.channels[c].channel), depth_name(depth),
          is_half ? "-65504 to 65504" : "0 to 1",
          is_half ? "--depth float" : "--depth half or float with .exr"));
    }
    clipped_.clear();
  }

  void write_model() {
    const StageTimer timer(job_->clock, "model");
    const std::vector<std::string> files = model_->write(*job_);
    job_->report.outputs.insert(job_->report.outputs.end(), files.begin(), files.end());
    tally_->wrote_model();
  }

  const TransferOptions options_;
  const std::string model_pattern_;  ///< of the output, if that is a model
  std::unique_ptr<JobContext> job_;
  mesh::Mesh source_, target_;
  Plan plan_;
  SourceStores source_stores_;
  TargetPlan target_plan_;                     ///< of the target at hand
  std::vector<std::array<float, 4>> factors_;  ///< by channel, of a model's materials
  std::optional<ModelOutput> model_;           ///< of the target at hand
  std::optional<TargetTally> tally_;           ///< of the target at hand
  struct Clipped {
    std::uint64_t samples = 0, images = 0;
    std::string first;  ///< image
  };
  std::vector<Clipped> clipped_;  ///< by channel, of the target at hand
  Lease source_lease_, target_lease_;
  Lease compressors_lease_;
  std::vector<std::unique_ptr<tiles::GeometryStore>> targets_;  ///< by pass, of the target at hand
  std::vector<Lease> target_leases_;
  double target_start_ = 0, target_share_ = 0;  ///< of the progress bar
  std::uint64_t texels_ = 0, done_texels_ = 0;  ///< of the target at hand, over all passes
  std::vector<std::string> source_files_;
  bool anything_to_write_ = false;  ///< --skip-existing may leave nothing to do
};

}  // namespace
}  // namespace flow

Report transfer(const TransferOptions& options, Progress* progress, Report* so_far) {
  return flow::run_job(options.resources, progress, so_far, [&](flow::JobRun& run, bool rebuild) {
    flow::describe(options, run.report);
    flow::check_options(options);
    flow::TransferJob(options, run, rebuild).run();
  });
}

}  // namespace pounce
