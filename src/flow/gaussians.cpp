// SPDX-License-Identifier: Apache-2.0
//
// The source alone, preconditioned and written for other programs: Gaussians of a mesh or a scene.
//
//   mesh + image ─▶ source stores ─▶ TexelSource ──┐ parts of its order ─▶ PLY, SPZ or glTF
//   splat scene  ─▶ SceneGaussians ─▶ filter, cut ─┘
//
// A mesh and a scene are two jobs here, since nothing of their preparation is shared: a mesh is
// read, binned and stored as a transfer's source is, a scene is read in place and not sorted. They
// meet in write_gaussians(), which sees a gaussian::GaussianSource and nothing else.
//
// The output has the order of the source (docs/gaussians.md), whatever threads, budget and cache
// are. So a mesh's Gaussians come from a TexelSource, which reads any range in that order, and not
// from the store of --method gaussian, which has the order of its sort.
#include "pounce/gaussians.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/sources/source.h"
#include "flow/sources/texel_source.h"
#include "flow/stores/splats.h"
#include "flow/write/gaussians.h"
#include "gaussian/gaussian_source.h"
#include "io/read_mesh.h"
#include "io/splats/scene.h"
#include "job/run_job.h"
#include "options/table.h"
#include "planning/describe_job.h"
#include "planning/load_mesh.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"

namespace pounce {
namespace flow {
namespace {

// Shares of the progress bar.
constexpr double kAfterReading = 0.02, kAfterColours = 0.3, kAfterGeometry = 0.4,
                 kAfterCount = 0.45;

/// From the axes of trained scenes (right, down, forward) to glTF's (left, up, forward), and back.
constexpr const char* kHalfTurn = "-x,-y,z";

class MeshJob {
 public:
  MeshJob(const GaussiansOptions& options, job::JobContext& job) : options_(options), job_(job) {
    job_.tile_cap_bytes = mesh::kTileCapBytes;
    file_.path = options.output;
  }

  void run() {
    plan();
    precondition_colours();
    precondition_geometry();
    // From here on only the stores are read, never the inputs.
    write();
  }

 private:
  std::uint64_t reading_bytes() const {
    return io::mesh_cost(options_.source, {options_.allow_external, {}, true}, job_.budget.limit())
        .peak_bytes;
  }

  void plan() {
    const StageTimer timer(job_.clock, "read");
    // The cost of reading is checked before the mesh is read, since it may exceed the budget by
    // far. All other needs are known only from the mesh.
    job_.meter.begin("read mesh", 1, "meshes", kAfterReading);
    require_early(job_, {reading_bytes(), "reading " + options_.source}, 0);
    const TransferOptions transfer = planning::as_transfer(options_);
    planning::PlacedMesh placed = planning::place_mesh(options_.source, transfer.source_use,
                                                       "source", options_.allow_external);
    mesh_ = std::move(placed.mesh);
    file_.facts.origin = placed.origin;
    job_.report.origin = {placed.origin.x, placed.origin.y, placed.origin.z};
    if (placed.origin != Vec3d{})
      job_.report.notes.push_back(planning::origin_note(options_.source, placed.origin));
    options::refuse_unsuitable(options_,
                               options::Source::mesh);  // now that it is known to be a mesh
    plan_ = planning::plan_mesh(transfer, mesh_, planning::TexelsAs::surface, false);
    // Coarsening replaces triangles by windows of texels (docs/decisions/022-coarse-sources.md). A
    // ray does not notice, but shapes and numbers of Gaussians are those of the triangles.
    plan_.passes.front().source.exact = true;  // each of its texels is one
    planning::warn_of_repeats(request(), plan_.warnings);
    for (const auto* warnings : {&mesh_.warnings, &plan_.warnings}) {
      job_.report.warnings.insert(job_.report.warnings.end(), warnings->begin(), warnings->end());
    }
    for (const auto* notes : {&mesh_.notes, &plan_.notes})
      job_.report.notes.insert(job_.report.notes.end(), notes->begin(), notes->end());
    for (const std::string& file : mesh_.files) planning::add_input(file, job_.report);
    for (const planning::ColumnPlan& column : plan_.columns)
      planning::add_input(column.image.path, job_.report);
    check_output();
    require_least(job_, least(), mesh_.size_bytes() + plan_.table_bytes);
    mesh_lease_ = runtime::Lease(job_.budget, mesh_.size_bytes(), "the mesh");
    leases_.emplace_back(job_.budget, job_.threads * store::Compressor::context_bytes(),
                         "the compressors");
    leases_.emplace_back(job_.budget, plan_.table_bytes, "the tables of --ocio");
    job_.meter.end();
  }

  void check_output() const {
    planning::check_outputs({options_.output});
    std::vector<std::string> inputs{options_.source};
    for (const planning::ColumnPlan& column : plan_.columns) inputs.push_back(column.image.path);
    planning::refuse_over_input(options_.output, inputs);
  }

  const surface::GeometryRequest& request() const { return plan_.passes.front().source; }

  job::LeastMemory least() const {
    // Steps follow each other, so the largest decides. The mesh is held until the geometry store
    // exists and is not counted for the writing that follows.
    const std::uint64_t contexts = job_.threads * store::Compressor::context_bytes();
    const std::uint64_t beside = contexts + mesh_.size_bytes();
    job::LeastMemory most{reading_bytes(), "reading " + options_.source};
    const auto need = [&most, this](std::uint64_t bytes, const std::string& why) {
      const std::uint64_t with_tables = bytes + plan_.table_bytes;
      if (with_tables > most.bytes) most = {with_tables, why};
    };
    if (plan_.table_loading_bytes > 0) {
      need(plan_.table_loading_bytes + mesh_.size_bytes(),
           "the tables of " + options_.colour.config);
    }
    std::uint64_t tile = 0;
    for (const planning::ColumnPlan& column : plan_.columns) {
      const std::uint64_t texel = column.info.channels * store::depth_bytes(column.info.depth);
      need(beside + colour_least_bytes(column.info.width, texel, column.info.decoder_bytes),
           "reading " + column.image.label);
      tile =
          std::max(tile, round_to_pages(store::kColourTileEdge * store::kColourTileEdge * texel));
    }
    const std::uint64_t building = surface::geometry_least_bytes(request(), job_.tile_cap_bytes);
    need(beside + building, "preconditioning " + options_.source);
    // No block exists yet. Its size is bounded by what a triangle may take before compression.
    const std::uint64_t triangles =
        std::min<std::uint64_t>(mesh_.triangles.size(), store::kMostTrianglesPerBlock);
    const std::uint64_t reading =
        TexelSource::read_bytes(triangles, triangles * 160 + (1 << 16), tile, options_.sharpen > 0);
    need(contexts + TexelSource::list_bytes(request()) +
             write_gaussians_least_bytes(file_, texel_count_bound(request()), reading),
         "writing " + options_.output);
    return most;
  }

  void precondition_colours() {
    const StageTimer timer(job_.clock, "precondition");
    columns_ = build_columns(job_, plan_, {}, kAfterColours);
  }

  void precondition_geometry() {
    const StageTimer timer(job_.clock, "precondition");
    job_.meter.begin("precondition", 0, "tiles", kAfterGeometry);
    bool cached = false;
    store_ = geometry_store(job_, request(), &cached);
    const store::GeometryDirectory& directory = store_->directory();
    leases_.emplace_back(job_.budget, store_->size_bytes(), "the directory of the source store");
    job_.report.source_tiles = directory.tiles.size();
    job_.report.source_store_bytes += store_->pack().size_bytes();
    job_.count_store(store_->pack(), cached);
    if (directory.degenerate > 0)
      job_.report.source_filtered["degenerate triangles"] = directory.degenerate;
    // The store has all that is left to read. The mesh goes before its lease does: the budget must
    // not promise memory that is still in use.
    mesh_ = {};
    mesh_lease_ = {};
    job_.meter.end();
  }

  std::unique_ptr<TexelSource> list() {
    const StageTimer timer(job_.clock, "count");
    TexelSource::Request texels;
    texels.geometry = store_.get();
    texels.pages = columns_.pages_of(plan_.channels.front(), plan_.passes.front().source.pages);
    texels.sigma = options_.sigma_texels.value_or(gaussian::kSigmaTexels);
    texels.sharpen = options_.sharpen;
    return std::make_unique<TexelSource>(job_, std::move(texels), kAfterCount);
  }

  void write() {
    const std::unique_ptr<TexelSource> source = list();
    io::check_splat_count(options_.output, source->count(), source->lobes());
    std::uint64_t accounted = write_gaussians(job_, *source, file_);
    if (accounted == 0) {
      throw Error(
          ErrorKind::input,
          options_.source +
              ": no triangle has both an area and a colour, so there is no Gaussian to write");
    }
    // Each Gaussian of the source is written, or filtered for a reason, or passed over while it is
    // read, since it lies in a UDIM tile without image. Nobody counts the last ones: they are the
    // difference.
    auto& filtered = job_.report.source_filtered;
    for (const auto reason : {store::SplatFilter::not_finite, store::SplatFilter::sizeless}) {
      const auto found = filtered.find(store::filter_name(reason));
      if (found != filtered.end()) accounted += found->second;
    }
    if (accounted < source->count())
      filtered["in a UDIM tile without image"] = source->count() - accounted;
    job_.report.bytes_read += store_->pack().bytes_read();
    job_.report.bytes_read += columns_.bytes_read();
    job_.report.tiles_read = store_->directory().tiles.size();
  }

  const GaussiansOptions& options_;
  job::JobContext& job_;
  GaussianFile file_;
  mesh::Mesh mesh_;
  planning::SourcePlan plan_;
  runtime::Lease mesh_lease_;
  std::vector<runtime::Lease> leases_;  ///< what stays in use until the job ends
  SourceColumns columns_;
  std::unique_ptr<store::GeometryStore> store_;
};

class SceneJob {
 public:
  SceneJob(const GaussiansOptions& options, job::JobContext& job)
      : options_(options), job_(job), request_(request()), scene_(open()) {}

  void run() {
    const io::SplatSceneInfo& info = scene_->info();
    if (info.are_points) {
      throw Error(ErrorKind::input,
                  options_.source +
                      ": a point cloud, which holds no Gaussians to write; transfer "
                      "takes it as a source as it is");
    }
    for (const std::string& file : info.files) planning::add_input(file, job_.report);
    planning::check_outputs({options_.output});
    planning::refuse_over_input(options_.output, info.files);
    const SceneGaussians source(*scene_,
                                store::kLobesOfDegree[std::min<std::uint32_t>(info.sh_degree, 3)]);
    GaussianFile file{options_.output,
                      {source.lobes(), info.model, info.is_linear},
                      request_.keep,
                      options_.count};
    // What the headers can refuse is refused before prepare(), which may write gigabytes of
    // scratch.
    check_size(source, file);
    require_least(job_, least(source, file), 0);
    prepare();
    tell();
    file.keep.lattice = lattice(source, file.keep);
    if (write_gaussians(job_, source, file) == 0) {
      throw Error(ErrorKind::input, fmt::format("{}: all of its {} Gaussians are left out ({})",
                                                options_.source, info.splats, left_out()));
    }
    for (const std::string& path : info.files) job_.report.bytes_read += job::size_on_disk({path});
  }

 private:
  std::unique_ptr<io::SplatScene> open() const {
    return io::open_splat_scene(options_.source, request_.axes, [this] { job_.meter.advance(0); });
  }

  planning::SplatRequest request() const {
    planning::SplatRequest request = planning::splat_request(planning::as_transfer(options_));
    if (turns()) {
      request.axes = parse_axes(kHalfTurn);
      // Filters see Gaussians after the rotation, so the box rotates as well. A rotation may
      // exchange low and high corners: the new box is around both.
      if (auto& box = request.keep.box) {  // the user's, of the scene as it is stored
        const Vec3f lo = request.axes.apply(box->lo), hi = request.axes.apply(box->hi);
        box.emplace();
        box->extend(lo);
        box->extend(hi);
      }
    }
    return request;
  }
  bool comes_from_gltf() const {
    return io::source_splat_format(options_.source)->kind == io::SplatKind::gltf;
  }
  bool goes_to_gltf() const { return io::splat_output(options_.output) == io::SplatOutput::glb; }
  /// Each side lies as its format says, unless the user does.
  bool turns() const { return options_.axes.empty() && comes_from_gltf() != goes_to_gltf(); }

  /// Says at once what could only be said after gigabytes were written: what is wanted, where no
  /// filter makes it less, is more than the format holds.
  void check_size(const SceneGaussians& source, const GaussianFile& file) const {
    const gaussian::SplatKeep& keep = file.keep;
    if (keep.min_alpha || keep.max_sigma || keep.box) return;
    const std::uint64_t wanted = std::min(source.count(), file.most.value_or(source.count()));
    io::check_splat_count(file.path, wanted, file.facts.lobes);
  }

  /// What a transfer leaves out since it lies far away from all the rest is of no use to anybody.
  store::SplatLattice lattice(const SceneGaussians& source, const gaussian::SplatKeep& keep) const {
    const runtime::Lease lease(job_.budget,
                               gaussian::kept_sample_bytes(source.count(), source.read_bytes()),
                               "scanning " + options_.source);
    return store::SplatLattice(gaussian::kept_sample(source, keep));
  }

  /// What is said of a scene is complete once it is prepared.
  void tell() {
    job_.report.notes = scene_->info().assumptions;
    if (scene_->info().sh_degree > 3) {
      job_.report.notes.emplace_back(
          "spherical harmonics of degree 4 are not written; degree 3 is the highest supported");
    }
    if (!options_.axes.empty()) return;
    job_.report.notes.push_back(
        !turns()
            ? fmt::format("{} has the same axes as {}", options_.output, options_.source)
            : fmt::format("{} is assumed to have {} and is rotated to {} ({}); --source-axes x,y,z "
                          "writes it as stored",
                          options_.source,
                          comes_from_gltf() ? "glTF axes (y up)"
                                            : "the axes of trained scenes (right, down, forward)",
                          comes_from_gltf() ? "the axes of trained scenes (right, down, forward)"
                                            : "glTF axes (y up)",
                          kHalfTurn));
  }

  job::LeastMemory least(const SceneGaussians& source, const GaussianFile& file) const {
    const std::uint64_t writing =
        write_gaussians_least_bytes(file, source.count(), source.read_bytes());
    const std::uint64_t preparing = scene_->prepare_bytes();
    const std::uint64_t looking = gaussian::kept_sample_bytes(source.count(), source.read_bytes());
    if (preparing > std::max(looking, writing)) return {preparing, "unpacking " + options_.source};
    if (looking > writing) return {looking, "scanning " + options_.source};
    return {writing, "writing " + options_.output};
  }

  void prepare() {
    const StageTimer timer(job_.clock, "read");
    job_.meter.begin("read", 0, "Gaussians", kAfterReading);
    const runtime::Lease lease(job_.budget, scene_->prepare_bytes(),
                               "unpacking " + options_.source);
    scene_->prepare(job_.scratch_place(), [this] { job_.meter.advance(0); });
    job_.meter.end();
  }

  std::string left_out() const {
    std::string text;
    for (const auto& [reason, words] : left_out_reasons()) {
      const auto found = job_.report.source_filtered.find(reason);
      if (found != job_.report.source_filtered.end())
        text += fmt::format("{}{} {}", text.empty() ? "" : ", ", found->second, words);
    }
    return text;
  }

  const GaussiansOptions& options_;
  job::JobContext& job_;
  const planning::SplatRequest request_;
  const std::unique_ptr<io::SplatScene> scene_;
};

void check_request(const GaussiansOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.source.empty() || o.output.empty()) usage("a source and an output are required");
  if (!io::splat_output(o.output)) {
    usage(o.output +
          ": Gaussians are written as .ply, .spz or .glb; choose one of these extensions");
  }
  for (const SourceTexture& texture : o.source_textures) {
    if (texture.channel != Channel::base_color)
      usage("--source-texture: Gaussians have only baseColor; specify that channel only");
  }
  options::check_ranges(o);
  planning::axes_of(planning::as_transfer(o).source_use, "source");
}

}  // namespace
}  // namespace flow

Report gaussians(const GaussiansOptions& options, Progress* progress, Report* so_far) {
  return job::run_job(options.resources, progress, so_far, [&](job::JobRun& run, bool rebuild) {
    planning::describe(options, run.report);
    flow::check_request(options);
    const bool is_scene = planning::is_splat_scene(options.source);
    if (is_scene) options::refuse_unsuitable(options, options::Source::splats);
    const auto job = job::open_job(options.resources, options.output, nullptr, rebuild, false, run);
    is_scene ? flow::SceneJob(options, *job).run() : flow::MeshJob(options, *job).run();
  });
}

}  // namespace pounce
