// SPDX-License-Identifier: Apache-2.0
#include "bench_input.h"
#include "store/blocks/geometry_block.h"

namespace pounce::bench {
namespace {

enum class Side { source, target };

const std::vector<store::GeometryBlock>& blocks_of(const PreparedJob& job, Side side) {
  return side == Side::source ? job.source_blocks : job.target_blocks;
}

double texels_of(const PreparedJob& job, Side side) {
  return static_cast<double>(side == Side::source ? job.source_texels() : job.target_texels());
}

/// Filter and compress every block. Per texel (target) or Gaussian (source) that the blocks stand
/// for.
void geometry_block_encode(benchmark::State& state, Side side) {
  PreparedJob& job = prepared_job(Shape::same, state.range(0));
  std::vector<std::byte> raw, stored;
  std::size_t bytes = 0;
  for (auto _ : state) {
    bytes = 0;
    for (const store::GeometryBlock& block : blocks_of(job, side)) {
      store::encode(block, raw);
      job.context->compressor().compress(raw, stored);
      bytes += stored.size();
    }
  }
  count_work(state, "texel", texels_of(job, side));
  state.counters["bytes_per_texel"] = static_cast<double>(bytes) / texels_of(job, side);
}
BENCHMARK_CAPTURE(geometry_block_encode, source, Side::source)
    ->Arg(1024)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(geometry_block_encode, target, Side::target)
    ->Arg(1024)
    ->Arg(2048)
    ->Unit(benchmark::kMillisecond);

/// Decompress, check and decode every block.
void geometry_block_decode(benchmark::State& state, Side side) {
  PreparedJob& job = prepared_job(Shape::same, state.range(0));
  struct Stored {
    std::vector<std::byte> bytes;
    std::size_t raw_bytes;
  };
  std::vector<Stored> stored;
  std::vector<std::byte> raw;
  for (const store::GeometryBlock& block : blocks_of(job, side)) {
    store::encode(block, raw);
    stored.push_back({{}, raw.size()});
    job.context->compressor().compress(raw, stored.back().bytes);
  }
  for (auto _ : state) {
    for (const Stored& block : stored) {
      raw.resize(block.raw_bytes);
      job.context->compressor().decompress(block.bytes, raw);
      benchmark::DoNotOptimize(store::decode_geometry(raw, "benchmark"));
    }
  }
  count_work(state, "texel", texels_of(job, side));
}
BENCHMARK_CAPTURE(geometry_block_decode, source, Side::source)
    ->Arg(1024)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(geometry_block_decode, target, Side::target)
    ->Arg(1024)
    ->Arg(2048)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
