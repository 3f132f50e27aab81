// SPDX-License-Identifier: Apache-2.0
#include "bench_input.h"
#include "projection/hit_packet.h"
#include "surface/target_block.h"

namespace pounce::bench {
namespace {

/// Decoded block to packets of texels (maps evaluated, windows clustered), as one piece of work
/// does. Per covered texel.
void target_block_packets(benchmark::State& state) {
  const PreparedJob& job = prepared_job(Shape::same, state.range(0));
  PageVector<surface::TexelPacket> packets;
  std::vector<surface::PacketGroup> groups;
  std::size_t made = 0;
  for (auto _ : state) {
    made = 0;
    for (const store::GeometryBlock& block : job.target_blocks) {
      packets.clear();
      groups.clear();
      const surface::TargetBlock maps(block, job.target_lattice(), job.target_plan.smallest_edge,
                                      surface::TargetBlock::Start::inset);
      maps.make_packets(0, packets, groups);
      made += packets.size();
      benchmark::DoNotOptimize(packets.data());
    }
  }
  const auto texels = static_cast<double>(job.target_texels());
  count_work(state, "texel", texels);
  state.counters["texels_per_packet"] = texels / static_cast<double>(made);
}
BENCHMARK(target_block_packets)->Arg(1024)->Arg(2048)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
