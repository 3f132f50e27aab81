// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "job/job_context.h"
#include "planning/plan.h"
#include "pounce/transfer.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_store.h"
#include "support/memory_file_system.h"

namespace pounce::bench {

// Input of all benchmarks: the reference job, a head of 10,000 triangles with a 1024 x 1024 texture
// (about 1M Gaussians), made by the fixtures' library when first asked for. Not thread-safe.

/// Makes input of 1/8 the size and 1/16 the triangles: for checking that every benchmark runs.
void make_input_small();
/// `size` as the benchmarks use it: itself, or 1/8 of it for small input.
std::uint32_t scaled(std::int64_t size);
/// A folder for this run's files; gone when the program ends.
const std::string& work_folder();

/// What the texture goes onto: the same surface with other triangles and UVs, or another head.
enum class Shape { same, other };

/// The reference job onto a square target image. Search distance: 1 % of the diagonal onto the same
/// shape, 5 % onto the other one. One thread, no cache.
TransferOptions reference_options(Shape shape, std::int64_t size);

/// The reference job with everything that its stages read, in memory.
struct PreparedJob {
  std::unique_ptr<FileSystem> files = test::make_memory_file_system();
  TransferOptions options;
  mesh::Mesh source, target;
  planning::SourcePlan plan;
  planning::TargetPlan target_plan;
  job::JobRun run{nullptr};
  std::unique_ptr<job::JobContext> context;
  std::unique_ptr<store::GeometryStore> source_store, target_store;
  std::unique_ptr<store::ColourStore> colours;
  std::vector<store::GeometryBlock> source_blocks, target_blocks;

  /// The only page of each side.
  const mesh::Lattice& source_lattice() const { return source_store->directory().pages[0]; }
  const mesh::Lattice& target_lattice() const { return target_store->directory().pages[0]; }
  std::uint64_t source_texels() const { return source_store->directory().texels; }
  std::uint64_t target_texels() const { return target_store->directory().texels; }
  const surface::GeometryRequest& source_request() const { return plan.passes[0].source; }
};

/// Made once per shape and size, then kept.
PreparedJob& prepared_job(Shape shape, std::int64_t size);

/// A texel of the target on its surface.
struct TargetTexel {
  Vec3f position, normal;
};
/// All that are covered: the projection maps, whole.
std::vector<TargetTexel> target_texels(const PreparedJob& job);

/// The tiles of the reference job's image, row after row.
std::vector<store::ColourTile> colour_tiles(PreparedJob& job);

/// Counters "per_<unit>" (seconds) and "<unit>/s" from how much one iteration works on.
void count_work(benchmark::State& state, const std::string& unit, double per_iteration);

}  // namespace pounce::bench
