// SPDX-License-Identifier: Apache-2.0
#include "bench_input.h"

#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <map>

#include "flow/stores/build_stores.h"
#include "io/read_mesh.h"
#include "job/run_job.h"
#include "recipes.h"
#include "surface/target_block.h"

namespace pounce::bench {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kTriangles = 10000;
constexpr std::int64_t kTextureSize = 1024;

bool small_input = false;

/// A folder that goes when the program ends, with all that is in it.
class WorkFolder {
 public:
  WorkFolder() {
    std::string pattern = (fs::temp_directory_path() / "pounce_bench_XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr)
      throw Error(ErrorKind::storage, pattern + ": a folder cannot be made here; set TMPDIR");
    path_ = pattern;
  }
  ~WorkFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// The folder with head_src.glb, head_same.glb and head_other.glb.
const std::string& heads() {
  static const std::string folder = [] {
    fixture::HeadOptions options;
    options.folder = work_folder() + "/heads";
    options.triangles = small_input ? kTriangles / 16 : kTriangles;
    options.texture_size = scaled(kTextureSize);
    options.target_size = 16;  // its truth is not used
    fixture::make_head(options);
    return options.folder;
  }();
  return folder;
}

std::vector<store::GeometryBlock> read_blocks(const store::GeometryStore& store,
                                              job::JobContext& job) {
  std::vector<store::GeometryBlock> blocks;
  for (std::uint32_t t = 0; t < store.directory().tiles.size(); ++t) {
    for (const store::BlockEntry& entry : store.read_index(t, job.compressor()))
      blocks.push_back(store.read_block(entry, job.compressor()));
  }
  return blocks;
}

std::unique_ptr<PreparedJob> prepare(Shape shape, std::int64_t size) {
  auto job = std::make_unique<PreparedJob>();
  job->options = reference_options(shape, size);
  job->source = io::read_mesh(job->options.source);
  job->target = io::read_mesh(job->options.targets.front());
  job->plan = planning::plan_mesh(job->options, job->source, planning::TexelsAs::surface, false);
  job->target_plan =
      planning::plan_target(job->options, job->plan, job->options.targets.front(), job->target);
  job->context = job::open_job(job->options.resources, job->options.output, job->files.get(), false,
                               false, job->run);
  job->context->tile_cap_bytes = mesh::kTileCapBytes;
  const planning::PassPlan& pass = job->plan.passes.at(0);
  bool cached = false;
  job->source_store = flow::geometry_store(*job->context, pass.source, &cached);
  job->target_store =
      flow::geometry_store(*job->context, job->target_plan.requests.at(0).at(0), &cached);
  const planning::ColumnPlan& column = job->plan.columns.at(0);
  const flow::ColourRequest request{&column.image, &column.info, column.wrap_u,
                                    column.wrap_v, {},           {}};
  const runtime::Lease reading(job->context->budget, flow::colour_least_bytes(request), "reading");
  job->colours =
      flow::whole_colours(*job->context, request, flow::colour_key(*job->context, request)).store;
  job->source_blocks = read_blocks(*job->source_store, *job->context);
  job->target_blocks = read_blocks(*job->target_store, *job->context);
  return job;
}

}  // namespace

void make_input_small() { small_input = true; }

std::uint32_t scaled(std::int64_t size) {
  return static_cast<std::uint32_t>(small_input ? size / 8 : size);
}

const std::string& work_folder() {
  static const WorkFolder folder;
  return folder.path();
}

TransferOptions reference_options(Shape shape, std::int64_t size) {
  TransferOptions options;
  options.source = heads() + "/head_src.glb";
  options.targets = {heads() + (shape == Shape::same ? "/head_same.glb" : "/head_other.glb")};
  options.output = work_folder() + "/out.png";
  options.image.size = ImageSize{scaled(size), scaled(size)};
  options.search.max_distance = Length{shape == Shape::same ? 1.0 : 5.0, true};
  options.resources.threads = 1;
  options.resources.use_cache = false;
  return options;
}

PreparedJob& prepared_job(Shape shape, std::int64_t size) {
  static std::map<std::pair<Shape, std::int64_t>, std::unique_ptr<PreparedJob>> jobs;
  auto& job = jobs[{shape, size}];
  if (job == nullptr) job = prepare(shape, size);
  return *job;
}

std::vector<store::ColourTile> colour_tiles(PreparedJob& job) {
  std::vector<store::ColourTile> read;
  for (std::uint32_t y = 0; y < job.colours->directory().tiles_y(); ++y) {
    for (const store::ChunkRef& chunk : job.colours->read_row(y, job.context->compressor()))
      read.push_back(job.colours->read_tile(chunk, job.context->compressor()));
  }
  return read;
}

std::vector<TargetTexel> target_texels(const PreparedJob& job) {
  std::vector<TargetTexel> texels;
  texels.reserve(job.target_texels());
  for (const store::GeometryBlock& block : job.target_blocks) {
    const surface::TargetBlock maps(block, job.target_lattice(), job.target_plan.smallest_edge);
    for (std::uint32_t i = 0; i < store::kTexelsPerBlock; ++i) {
      if (!maps.covered(i)) continue;
      const auto texel = maps.texel(i);
      texels.push_back({texel.position, texel.normal});
    }
  }
  return texels;
}

void count_work(benchmark::State& state, const std::string& unit, double per_iteration) {
  using benchmark::Counter;
  state.counters[unit + "/s"] = Counter(per_iteration, Counter::kIsIterationInvariantRate);
  state.counters["per_" + unit] =
      Counter(per_iteration, Counter::kIsIterationInvariantRate | Counter::kInvert);
}

}  // namespace pounce::bench
