// SPDX-License-Identifier: Apache-2.0
//
// Whole jobs through the public interface, files included. Counters besides time, all per covered
// target texel (seconds, bytes):
//   per_texel                     wall time of everything
//   kernel                        CPU of precondition + vectorize + project + assemble: no image
//                                 files, no start of the program
//   project, decode, encode       CPU of these stages alone
//   read_B, written_B             bytes of stores
// and peak_rss_MiB: the most memory the process had resident during the jobs (VmHWM).
#include <filesystem>
#include <fstream>
#include <map>

#include "bench_input.h"
#include "flow/transfer.h"
#include "support/memory_file_system.h"

namespace pounce::bench {
namespace {

/// VmHWM starts anew where the kernel lets us; else it is the peak since the program began.
void reset_peak_rss() { std::ofstream("/proc/self/clear_refs") << "5"; }

double peak_rss_mib() {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    double kib = 0;
    if (word == "VmHWM:" && status >> kib) return kib / 1024;
  }
  return 0;
}

/// Sums of what the jobs of one benchmark reported.
class JobTotals {
 public:
  void add(const Report& report) {
    texels_ += static_cast<double>(report.target_covered);
    read_ += static_cast<double>(report.bytes_read);
    written_ += static_cast<double>(report.bytes_written);
    for (const StageTime& stage : report.stages) cpu_[stage.name] += stage.cpu_s;
    ++jobs_;
  }
  void publish(benchmark::State& state) const {
    count_work(state, "texel", texels_ / jobs_);
    const auto cpu = [&](std::initializer_list<const char*> stages) {
      double seconds = 0;
      for (const char* stage : stages) {
        const auto found = cpu_.find(stage);
        if (found != cpu_.end()) seconds += found->second;
      }
      return seconds / texels_;
    };
    state.counters["kernel"] = cpu({"precondition", "vectorize", "project", "assemble"});
    state.counters["project"] = cpu({"project"});
    state.counters["decode"] = cpu({"decode"});
    state.counters["encode"] = cpu({"encode"});
    state.counters["read_B"] = read_ / texels_;
    state.counters["written_B"] = written_ / texels_;
    state.counters["peak_rss_MiB"] = peak_rss_mib();
  }

 private:
  double jobs_ = 0, texels_ = 0, read_ = 0, written_ = 0;
  std::map<std::string, double> cpu_;
};

/// range(0): side of the target image; range(1): threads.
TransferOptions options_for(Shape shape, const benchmark::State& state) {
  TransferOptions options = reference_options(shape, state.range(0));
  options.resources.threads = static_cast<unsigned>(state.range(1));
  return options;
}

void run_jobs(benchmark::State& state, const TransferOptions& options,
              const job::TestKnobs& knobs = {}) {
  JobTotals totals;
  reset_peak_rss();
  for (auto _ : state) totals.add(flow::transfer(options, knobs));
  totals.publish(state);
}

/// All stores in memory.
void transfer_in_core(benchmark::State& state, Shape shape) {
  const auto in_memory = test::make_memory_file_system();
  run_jobs(state, options_for(shape, state), {.files = in_memory.get()});
}

/// Stores in scratch files, ample memory.
void transfer_files(benchmark::State& state, Shape shape) {
  run_jobs(state, options_for(shape, state));
}

/// Stores in scratch files and hardly more memory than the least that works.
void transfer_small_budget(benchmark::State& state, Shape shape) {
  TransferOptions options = options_for(shape, state);
  const std::uint64_t least = plan(options).least_memory_bytes;
  options.resources.memory_bytes = least + least / 8;
  run_jobs(state, options);
  state.counters["budget_MiB"] = static_cast<double>(options.resources.memory_bytes) / (1 << 20);
}

/// The first run with a cache: everything is built and kept.
void transfer_cold_cache(benchmark::State& state, Shape shape) {
  TransferOptions options = options_for(shape, state);
  options.resources.use_cache = true;
  options.resources.cache_dir = work_folder() + "/cold";
  JobTotals totals;
  reset_peak_rss();
  for (auto _ : state) {
    totals.add(transfer(options));
    state.PauseTiming();
    std::filesystem::remove_all(options.resources.cache_dir);
    state.ResumeTiming();
  }
  totals.publish(state);
}

/// A later run: source and target come from the cache.
void transfer_warm_cache(benchmark::State& state, Shape shape) {
  TransferOptions options = options_for(shape, state);
  options.resources.use_cache = true;
  options.resources.cache_dir = work_folder() + "/warm";
  transfer(options);
  run_jobs(state, options);
}

void as_job(benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgNames({"", "threads"})
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime()
      ->MeasureProcessCPUTime();
}

BENCHMARK_CAPTURE(transfer_in_core, same, Shape::same)
    ->Apply(as_job)
    ->Args({1024, 1})
    ->Args({2048, 1})
    ->Args({2048, 2});
BENCHMARK_CAPTURE(transfer_in_core, other, Shape::other)->Apply(as_job)->Args({1024, 1});
BENCHMARK_CAPTURE(transfer_files, same, Shape::same)->Apply(as_job)->Args({1024, 1});
BENCHMARK_CAPTURE(transfer_small_budget, same, Shape::same)
    ->Apply(as_job)
    ->Args({1024, 1})
    ->Args({2048, 1});
BENCHMARK_CAPTURE(transfer_cold_cache, same, Shape::same)->Apply(as_job)->Args({1024, 1});
BENCHMARK_CAPTURE(transfer_warm_cache, same, Shape::same)->Apply(as_job)->Args({1024, 1});

}  // namespace
}  // namespace pounce::bench
