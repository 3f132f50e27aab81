// SPDX-License-Identifier: Apache-2.0
#include "bench_input.h"

namespace pounce::bench {
namespace {

double image_texels(const PreparedJob& job) {
  const store::ColourDirectory& image = job.colours->directory();
  return static_cast<double>(image.width) * image.height;
}

/// Filter and compress every tile of the source's texture. Per texel of the image (without aprons).
void colour_tile_encode(benchmark::State& state) {
  PreparedJob& job = prepared_job(Shape::same, state.range(0));
  const auto tiles = colour_tiles(job);
  std::vector<std::byte> raw, stored;
  std::size_t bytes = 0;
  for (auto _ : state) {
    bytes = 0;
    for (const store::ColourTile& tile : tiles) {
      store::filter_colours(job.colours->directory(), tile, raw);
      job.context->compressor().compress(raw, stored);
      bytes += stored.size();
    }
  }
  count_work(state, "texel", image_texels(job));
  state.counters["bytes_per_texel"] = static_cast<double>(bytes) / image_texels(job);
}
BENCHMARK(colour_tile_encode)->Arg(1024)->Unit(benchmark::kMillisecond);

/// Read (from memory), check, decompress and decode every tile, as a blend that misses the cache
/// does.
void colour_tile_read(benchmark::State& state) {
  PreparedJob& job = prepared_job(Shape::same, state.range(0));
  std::vector<store::ChunkRef> chunks;
  for (std::uint32_t y = 0; y < job.colours->directory().tiles_y(); ++y) {
    const auto row = job.colours->read_row(y, job.context->compressor());
    chunks.insert(chunks.end(), row.begin(), row.end());
  }
  for (auto _ : state) {
    for (const store::ChunkRef& chunk : chunks)
      benchmark::DoNotOptimize(job.colours->read_tile(chunk, job.context->compressor()));
  }
  count_work(state, "texel", image_texels(job));
}
BENCHMARK(colour_tile_read)->Arg(1024)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
