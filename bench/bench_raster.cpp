// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "bench_input.h"
#include "mesh/block_bins.h"
#include "mesh/uv_raster.h"

namespace pounce::bench {
namespace {

/// UV triangles into 64x64 windows, as vectorization does it. Per texel covered.
void raster_windows(benchmark::State& state) {
  const PreparedJob& job = prepared_job(Shape::same, state.range(0));
  std::uint64_t texels = 0;
  for (auto _ : state) {
    texels = 0;
    for (const store::GeometryBlock& block : job.target_blocks) {
      const mesh::TexelWindow window{std::int64_t{block.x} * mesh::kBlockEdge,
                                     std::int64_t{block.y} * mesh::kBlockEdge,
                                     std::int64_t{block.x + 1} * mesh::kBlockEdge,
                                     std::int64_t{block.y + 1} * mesh::kBlockEdge};
      std::array<std::uint32_t, store::kTexelsPerBlock> owner;
      for (std::uint32_t t = 0; t < block.triangles.size(); ++t) {
        mesh::raster_triangle(block.texel_corners(job.target_lattice(), t), window,
                              [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
                                for (std::int64_t x = begin; x < end; ++x) {
                                  owner[static_cast<std::size_t>(
                                      (y - window.y0) * mesh::kBlockEdge + x - window.x0)] = t;
                                }
                                texels += static_cast<std::uint64_t>(end - begin);
                              });
      }
      benchmark::DoNotOptimize(owner);
    }
  }
  count_work(state, "texel", static_cast<double>(texels));
}
BENCHMARK(raster_windows)->Arg(1024)->Arg(2048)->Unit(benchmark::kMillisecond);

/// Which triangles touch which window, and windows to tiles. Per triangle.
void raster_bins(benchmark::State& state) {
  const PreparedJob& job = prepared_job(Shape::same, state.range(0));
  const surface::GeometryRequest& target = job.target_plan.requests[0][0];
  for (auto _ : state) {
    const mesh::BlockBinner binner({&job.target, target.pages, target.triangles.get(), 0, true,
                                    std::nullopt, job.context->tile_cap_bytes});
    for (std::size_t band = 0; band < binner.bands(); ++band)
      benchmark::DoNotOptimize(binner.bin(band));
  }
  count_work(state, "triangle", static_cast<double>(job.target.triangles.size()));
}
BENCHMARK(raster_bins)->Arg(1024)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
