// SPDX-License-Identifier: Apache-2.0
//
// The source alone, preconditioned and written for other programs: a mesh as Gaussians.
//
//   mesh + image ─▶ source stores ─▶ TexelSource ─▶ parts of its order ─▶ rows of a 3DGS PLY
#include "pounce/gaussians.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "flow/build/source_columns.h"
#include "flow/build/texel_source.h"
#include "flow/describe_job.h"
#include "flow/job.h"
#include "flow/plan/output_names.h"
#include "flow/plan/plan.h"
#include "flow/plan/uv_repeats.h"
#include "io/files/file_ending.h"
#include "io/read_mesh.h"
#include "io/splats/ply_write.h"
#include "runtime/ordered_stream.h"

namespace pounce {
namespace flow {
namespace {

// Shares of the progress bar.
constexpr double kAfterReading = 0.02, kAfterColours = 0.3, kAfterGeometry = 0.4,
                 kAfterCount = 0.45;

constexpr std::uint64_t kPartRows = 16384;
/// Opacity is a logit: alpha 0 and 1 would be infinite. exp(-10) is a 22000th.
constexpr float kLargestLogit = 10;

bool ends_in_ply(const std::string& path) { return io::lower_ending(path) == ".ply"; }

float opacity_of(float alpha) {
  if (!(alpha > 0)) return -kLargestLogit;
  if (alpha >= 1) return kLargestLogit;
  const double logit = std::log(double{alpha} / (1 - double{alpha}));
  return std::clamp(static_cast<float>(logit), -kLargestLogit, kLargestLogit);
}

class GaussiansJob {
 public:
  GaussiansJob(const GaussiansOptions& options, JobRun& run, bool rebuild)
      : options_(options),
        job_(open_job(options.resources, options.output, false, rebuild, false, run)) {
    job_->tile_cap_bytes = kTileCapBytes;
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
    return io::mesh_cost(options_.source, {options_.allow_external, {}}, job_->budget.limit())
        .peak_bytes;
  }

  void plan() {
    const StageTimer timer(job_->clock, "read");
    job_->meter.begin("read mesh", 1, "meshes", kAfterReading);
    require_reading(*job_, reading_bytes(), options_.source);
    mesh_ = io::read_mesh(options_.source, {options_.allow_external, {}});
    TransferOptions transfer;
    transfer.source = options_.source;
    transfer.source_textures = options_.source_textures;
    transfer.channels = {Channel::base_color};
    transfer.output = "colours.exr";  // a format that holds any image: nothing is written there
    plan_ = plan_source(transfer, mesh_);
    plan_.passes.front().source.exact = true;  // each of its texels is one
    warn_of_repeats(request(), plan_.warnings);
    for (const auto* warnings : {&mesh_.warnings, &plan_.warnings}) {
      job_->report.warnings.insert(job_->report.warnings.end(), warnings->begin(), warnings->end());
    }
    for (const std::string& file : mesh_.files) add_input(file, job_->report);
    for (const ColumnPlan& column : plan_.columns) add_input(column.image.path, job_->report);
    check_output();
    require_least(*job_, least());
    mesh_lease_ = runtime::Lease(job_->budget, mesh_.size_bytes(), "the mesh");
    leases_.emplace_back(job_->budget, job_->threads * store::Compressor::context_bytes(),
                         "the compressors");
    job_->meter.end();
  }

  void check_output() const {
    check_outputs({options_.output});
    std::vector<std::string> inputs{options_.source};
    for (const ColumnPlan& column : plan_.columns) inputs.push_back(column.image.path);
    for (const std::string& input : inputs) {
      std::error_code ignored;
      if (!input.empty() && std::filesystem::equivalent(options_.output, input, ignored)) {
        throw Error(ErrorKind::usage,
                    options_.output + ": is also an input; write to another file");
      }
    }
  }

  const GeometryRequest& request() const { return plan_.passes.front().source; }

  LeastMemory least() const {
    const std::uint64_t contexts = job_->threads * store::Compressor::context_bytes();
    const std::uint64_t beside = contexts + mesh_.size_bytes();
    LeastMemory most{reading_bytes(), "reading " + options_.source};
    const auto need = [&most](std::uint64_t bytes, const std::string& why) {
      if (bytes > most.bytes) most = {bytes, why};
    };
    std::uint64_t tile = 0;
    for (const ColumnPlan& column : plan_.columns) {
      const std::uint64_t texel = column.info.channels * store::depth_bytes(column.info.depth);
      need(beside + colour_least_bytes(column.info.width, texel, column.info.decoder_bytes),
           "reading " + column.image.label);
      tile =
          std::max(tile, round_to_pages(store::kColourTileEdge * store::kColourTileEdge * texel));
    }
    const std::uint64_t building = geometry_least_bytes(request(), job_->tile_cap_bytes);
    need(beside + building, "preconditioning " + options_.source);
    const std::uint64_t triangles =
        std::min<std::uint64_t>(mesh_.triangles.size(), store::kMostTrianglesPerBlock);
    const std::uint64_t lists =  // of blocks, and of parts of 16 thousand
        TexelSource::list_bytes(request()) +
        round_to_pages(texel_count_bound(request()) / kPartRows * sizeof(std::uint64_t)) +
        kPageBytes;
    need(contexts + lists + round_to_pages(kPartRows * sizeof(io::SplatPlyRow)) +
             TexelSource::read_bytes(triangles, triangles * 160 + (1 << 16), tile),
         "writing " + options_.output);
    return most;
  }

  void precondition_colours() {
    const StageTimer timer(job_->clock, "precondition");
    columns_ = build_columns(*job_, plan_, kAfterColours);
  }

  void precondition_geometry() {
    const StageTimer timer(job_->clock, "precondition");
    job_->meter.begin("precondition", 0, "tiles", kAfterGeometry);
    bool cached = false;
    store_ = geometry_store(*job_, request(), &cached);
    const store::GeometryDirectory& directory = store_->directory();
    leases_.emplace_back(job_->budget, store_->size_bytes(), "the directory of the source store");
    job_->report.source_tiles = directory.tiles.size();
    job_->report.source_store_bytes += store_->pack().size_bytes();
    job_->count_store(store_->pack(), cached);
    if (directory.degenerate > 0)
      job_->report.source_filtered["degenerate triangles"] = directory.degenerate;
    mesh_ = {};
    mesh_lease_ = {};
    job_->meter.end();
  }

  // --- the rows
  // -----------------------------------------------------------------------------------

  std::unique_ptr<TexelSource> list() {
    const StageTimer timer(job_->clock, "count");
    TexelSource::Request texels;
    texels.geometry = store_.get();
    texels.pages = columns_.pages_of(plan_.channels.front());
    return std::make_unique<TexelSource>(*job_, std::move(texels), kAfterCount);
  }

  void write() {
    const std::unique_ptr<TexelSource> source = list();
    const StageTimer timer(job_->clock, "write");
    const std::uint64_t total = source->count();
    const std::uint64_t parts = (total + kPartRows - 1) / kPartRows;
    const runtime::Lease list(job_->budget, round_to_pages(parts * sizeof(std::uint64_t)),
                              "the list of parts");
    const PageVector<std::uint64_t> costs(
        parts, round_to_pages(kPartRows * sizeof(io::SplatPlyRow)) + source->read_bytes());
    job_->meter.begin("write", total, "Gaussians", 1);
    io::SplatPlyWriter writer(options_.output);
    using Rows = PageVector<io::SplatPlyRow>;
    const auto end = [&](std::size_t part) { return std::min((part + 1) * kPartRows, total); };
    runtime::run_ordered<Rows>(
        job_->budget, costs, "writing " + options_.output,
        [&](std::size_t i) { return make_rows(*source, i * kPartRows, end(i)); },
        [&](std::size_t i, Rows& rows) {
          const WorkTimer encoding(job_->clock, "encode");
          writer.write(rows);
          job_->meter.advance(end(i) - i * kPartRows);
        });
    finish(writer, total);
    job_->meter.end();
  }

  void finish(io::SplatPlyWriter& writer, std::uint64_t counted) {
    const std::uint64_t rows = writer.rows();
    if (rows == 0) {
      throw Error(ErrorKind::input, options_.source +
                                        ": none of its triangles has an area and a colour, so "
                                        "there is no Gaussian to write");
    }
    if (rows < counted)
      job_->report.source_filtered["in a UDIM tile without image"] = counted - rows;
    writer.commit();
    job_->report.outputs = {options_.output};
    job_->report.source_gaussians = rows;
    job_->report.bytes_written += rows * sizeof(io::SplatPlyRow);
    job_->report.bytes_read += store_->pack().bytes_read();
    job_->report.bytes_read += columns_.bytes_read();
    job_->report.tiles_read = store_->directory().tiles.size();
  }

  static PageVector<io::SplatPlyRow> make_rows(const TexelSource& source, std::uint64_t first,
                                               std::uint64_t last) {
    PageVector<io::SplatPlyRow> rows;
    rows.reserve(last - first);
    source.visit(first, last, [&](const TexelGaussian& texel) { rows.push_back(row_of(texel)); });
    return rows;
  }

  static io::SplatPlyRow row_of(const TexelGaussian& texel) {
    io::SplatPlyRow row;
    std::memcpy(row.position, &texel.place.mean, sizeof row.position);
    std::memcpy(row.normal, &texel.place.normal, sizeof row.normal);
    for (std::size_t c = 0; c < 3; ++c)
      row.dc[c] = static_cast<float>((double{texel.rgba[c]} - 0.5) / io::kDegree0);
    row.opacity = opacity_of(texel.rgba[3]);
    for (std::size_t i = 0; i < 3; ++i)
      row.scale[i] = static_cast<float>(std::log(texel.shape.sigma[i]));
    for (std::size_t i = 0; i < 4; ++i)
      row.rotation[i] = static_cast<float>(texel.shape.rotation[i]);
    return row;
  }

  const GaussiansOptions& options_;
  std::unique_ptr<JobContext> job_;
  mesh::Mesh mesh_;
  Plan plan_;
  runtime::Lease mesh_lease_;
  std::vector<runtime::Lease> leases_;  ///< what stays in use until the job ends
  SourceColumns columns_;
  std::unique_ptr<store::GeometryStore> store_;
};

void check_options(const GaussiansOptions& o) {
  if (o.source.empty() || o.output.empty())
    throw Error(ErrorKind::usage, "a source and an output are needed");
  if (ends_in_ply(o.source)) {
    throw Error(ErrorKind::usage,
                o.source +
                    ": Gaussians are made from a textured mesh (.glb, .gltf or .obj); a "
                    "splat scene has them already");
  }
  if (!ends_in_ply(o.output))
    throw Error(ErrorKind::usage, o.output + ": Gaussians are written as .ply; name it so");
}

}  // namespace
}  // namespace flow

Report gaussians(const GaussiansOptions& options, Progress* progress, Report* so_far) {
  return flow::run_job(options.resources, progress, so_far, [&](flow::JobRun& run, bool rebuild) {
    flow::describe(options, run.report);
    flow::check_options(options);
    flow::GaussiansJob(options, run, rebuild).run();
  });
}

}  // namespace pounce
