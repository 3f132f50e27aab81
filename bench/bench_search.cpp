// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include "bench_input.h"
#include "projection/search.h"

namespace pounce::bench {
namespace {

constexpr std::size_t kBlocksPerPiece = 8;

/// The search alone: everything from "nothing found" to the winners of all texels, against one grid
/// that holds the whole source. Per covered texel. What streaming adds (reading blocks, a grid per
/// batch) is in bench_transfer.
class SearchInput {
 public:
  explicit SearchInput(const PreparedJob& job) {
    for (const store::GeometryBlock& block : job.source_blocks)
      blocks_.push_back(surface::make_source_block(block, job.source_lattice()));
    std::vector<const surface::SourceBlock*> pointers;
    for (const surface::SourceBlock& block : blocks_) pointers.push_back(&block);
    patches_ = std::make_unique<grid::BatchPatches>(
        pointers, job.source_store->directory().box.grown(job.target_plan.max_distance));
    for (std::size_t b = 0; b < job.target_blocks.size(); ++b) {
      if (b % kBlocksPerPiece == 0) pieces_.emplace_back();
      const surface::TargetBlock maps(job.target_blocks[b], job.target_lattice(),
                                      job.target_plan.smallest_edge,
                                      surface::TargetBlock::Start::inset);
      maps.make_packets(static_cast<std::uint32_t>(b % kBlocksPerPiece), pieces_.back().packets,
                        pieces_.back().groups);
    }
    limits_.max_distance = job.target_plan.max_distance;
    limits_.min_cosine =
        static_cast<float>(std::cos(job.options.search.max_angle_deg * std::numbers::pi / 180));
    heights_ = projection::search_heights(limits_.max_distance);
  }

  /// Texels that found something.
  std::uint64_t search(const projection::Kernels& kernels, benchmark::State& state) const {
    std::uint64_t found = 0;
    for (const projection::SearchState& piece : pieces_) {
      state.PauseTiming();
      projection::SearchState work = piece;
      state.ResumeTiming();
      projection::start(work);
      for (const float height : heights_) {
        if (work.open.empty()) break;
        projection::search_batch(*patches_, height, limits_, kernels, work);
        projection::close_groups(height, kernels, work);
      }
      state.PauseTiming();
      for (std::size_t p = 0; p < work.packets.size(); ++p) {
        for (int lane = 0; lane < surface::kLanes; ++lane) {
          if (work.packets[p].texel[lane] != surface::kNoTexel &&
              work.hits[p].key[lane] != projection::kNoHit) {
            ++found;
          }
        }
      }
      state.ResumeTiming();
    }
    return found;
  }

 private:
  std::vector<surface::SourceBlock> blocks_;
  std::unique_ptr<grid::BatchPatches> patches_;
  std::vector<projection::SearchState> pieces_;
  projection::SearchLimits limits_;
  std::vector<float> heights_;
};

void search(benchmark::State& state, Shape shape, const char* isa) {
  const PreparedJob& job = prepared_job(shape, state.range(0));
  const projection::Kernels* kernels = nullptr;
  try {
    kernels = &projection::kernels(isa);
  } catch (const Error& e) {
    state.SetLabel("skipped: this processor lacks it");
    for (auto _ : state) {
    }
    return;
  }
  const SearchInput input(job);
  std::uint64_t found = 0;
  for (auto _ : state) found = input.search(*kernels, state);
  const auto texels = static_cast<double>(job.target_texels());
  count_work(state, "texel", texels);
  state.counters["found"] = static_cast<double>(found) / texels;
}
BENCHMARK_CAPTURE(search, same_sse2, Shape::same, "sse2")->Arg(1024)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(search, same_avx2, Shape::same, "avx2")->Arg(1024)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(search, same_avx512, Shape::same, "avx512")
    ->Arg(1024)
    ->Arg(2048)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(search, other_sse2, Shape::other, "sse2")
    ->Arg(1024)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(search, other_avx2, Shape::other, "avx2")
    ->Arg(1024)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(search, other_avx512, Shape::other, "avx512")
    ->Arg(1024)
    ->Arg(2048)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
