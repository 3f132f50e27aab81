// SPDX-License-Identifier: Apache-2.0
#include "bench_input.h"
#include "grid/patch_grid.h"
#include "projection/search.h"

namespace pounce::bench {
namespace {

struct Blocks {
  std::vector<surface::SourceBlock> made;
  std::vector<const surface::SourceBlock*> pointers;
  std::size_t patches = 0;
};

Blocks source_blocks(const PreparedJob& job) {
  Blocks blocks;
  for (const store::GeometryBlock& block : job.source_blocks)
    blocks.made.push_back(surface::make_source_block(block, job.source_lattice()));
  for (const surface::SourceBlock& block : blocks.made) {
    blocks.pointers.push_back(&block);
    blocks.patches += block.patches.size();
  }
  return blocks;
}

/// One grid over the whole source. Per patch.
void grid_build(benchmark::State& state) {
  const PreparedJob& job = prepared_job(Shape::same, state.range(0));
  const Blocks blocks = source_blocks(job);
  for (auto _ : state) {
    const grid::PatchGrid grid(blocks.pointers, job.source_store->directory().box);
    benchmark::DoNotOptimize(&grid);
  }
  count_work(state, "patch", static_cast<double>(blocks.patches));
}
BENCHMARK(grid_build)->Arg(1024)->Unit(benchmark::kMillisecond);

/// Queries along the rays of the target's packets, up to the search distance. Per query.
void grid_query(benchmark::State& state) {
  const PreparedJob& job = prepared_job(Shape::same, state.range(0));
  const Blocks blocks = source_blocks(job);
  grid::PatchGrid grid(blocks.pointers,
                       job.source_store->directory().box.grown(job.target_plan.max_distance));
  projection::SearchState target;
  for (const store::GeometryBlock& block : job.target_blocks) {
    surface::TargetBlock(block, job.target_lattice(), job.target_plan.smallest_edge)
        .make_packets(0, target.packets, target.groups);
  }
  projection::start(target);
  std::size_t found = 0;
  for (auto _ : state) {
    found = 0;
    for (const RayBundle& bundle : target.bundles)
      grid.query(bundle, job.target_plan.max_distance, [&](const auto&) { ++found; });
    benchmark::DoNotOptimize(found);
  }
  const auto queries = static_cast<double>(target.bundles.size());
  count_work(state, "query", queries);
  state.counters["found_per_query"] = static_cast<double>(found) / queries;
}
BENCHMARK(grid_query)->Arg(1024)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
