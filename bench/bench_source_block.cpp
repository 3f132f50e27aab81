// SPDX-License-Identifier: Apache-2.0
#include "bench_input.h"
#include "surface/source_block.h"

namespace pounce::bench {
namespace {

/// Decoded block to facets and patches. Per triangle of a block (one that is cut counts in each).
void source_block_setup(benchmark::State& state) {
  const PreparedJob& job = prepared_job(Shape::same, state.range(0));
  std::size_t triangles = 0, patches = 0;
  for (auto _ : state) {
    triangles = patches = 0;
    for (const store::GeometryBlock& block : job.source_blocks) {
      const surface::SourceBlock made = surface::make_source_block(block, job.source_lattice());
      triangles += block.triangles.size();
      patches += made.patches.size();
      benchmark::DoNotOptimize(made.facets.data());
    }
  }
  count_work(state, "triangle", static_cast<double>(triangles));
  state.counters["patches_per_triangle"] =
      static_cast<double>(patches) / static_cast<double>(triangles);
}
BENCHMARK(source_block_setup)->Arg(1024)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
