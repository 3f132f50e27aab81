// SPDX-License-Identifier: Apache-2.0
//
// How a job begins and ends, whatever it is: threads of its own, a budget, a cache or scratch
// stores, one more attempt where a pack turns out to be damaged, and a report in any case.
//
// A job runs in an arena of its own. Its report exists from the first line and reaches the caller
// whatever happens. A second attempt begins from nothing but the inputs: only JobRun lives through
// both. It is made once, and only with a cache.
#include "job/run_job.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "core/instruction_set.h"
#include "core/own_errors.h"
#include "core/system_limits.h"
#include "io/files/output_file.h"
#include "pounce/cache.h"
#include "pounce/version.h"
#include "store/cache/cache_space.h"

namespace pounce::job {
namespace {

/// What takes no more than this to plan is planned even if the budget is smaller, to say exactly
/// how much the job needs.
constexpr std::uint64_t kLookAnyway = 64ULL << 20;
/// No job has less.
constexpr std::uint64_t kLeastBudget = 1ULL << 20;

/// As many as were asked for, but no more than the process lets TBB have: raising that would raise
/// it for all that runs there.
unsigned thread_count(const Resources& resources) {
  const auto most = static_cast<unsigned>(
      tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  return resources.threads != 0 ? std::min(resources.threads, most) : most;
}

/// The output's folder, or the nearest above it that is there; of a pattern that has tokens in its
/// folders, the one above them all.
std::string scratch_folder(const Resources& resources, const std::string& output) {
  if (!resources.temp_dir.empty()) return resources.temp_dir;
  std::filesystem::path folder = std::filesystem::path(output).parent_path();
  while (folder.string().find('<') != std::string::npos && folder.has_relative_path())
    folder = folder.parent_path();
  return io::existing_folder(folder.string());
}

std::uint64_t cache_limit(const Resources& resources, const std::string& cache, FileSystem& files) {
  if (resources.cache_limit_bytes) return *resources.cache_limit_bytes;
  try {
    return store::default_limit_bytes(files, cache);
  } catch (const Error&) {
    return 0;  // a folder that cannot be looked at cannot be opened either, and that is said then
  }
}

std::uint64_t scratch_limit(const Resources& resources, const std::string& folder) {
  if (resources.max_temp_bytes) return *resources.max_temp_bytes;
  try {
    return default_scratch_limit(posix_file_system(), folder);
  } catch (const Error&) {
    return 0;  // where nothing can be looked at nothing can be made either, and that is said then
  }
}

/// Counts what the job's scratch files take, and lets it be no more than --max-temp.
void count_scratch_files(const Resources& resources, JobContext& job) {
  job.scratch_limit_bytes = scratch_limit(resources, job.scratch_folder);
  const auto refusal = [&job] {
    const std::uint64_t most = job.report.disk_most.value_or(DiskForecast{}).scratch_bytes;
    return fmt::format(
        "{}: the job's scratch files would need more than {}{}; raise the limit with --max-temp, "
        "or choose a folder with more space with --temp",
        job.scratch_folder, runtime::format_bytes(job.scratch_limit_bytes),
        most > 0 ? fmt::format(" (the job needs {} at most)", runtime::format_bytes(most)) : "");
  };
  job.scratch_account =
      std::make_shared<ScratchAccount>(job.scratch_limit_bytes, refusal, !resources.max_temp_bytes);
  job.counted_files = make_counting_file_system(job.scratch_account);
  job.files = job.counted_files.get();
}

/// How this job deals with the other users of its cache.
store::CacheOptions cache_options(const Resources& resources, const std::string& scratch,
                                  bool rebuild, JobContext& job) {
  store::CacheOptions options;
  options.limit_bytes = job.cache_limit_bytes;
  options.scratch_folder = scratch;
  options.verify = rebuild;
  options.second_root = resources.cache_readonly_dir;
  if (!options.second_root.empty() && !job.files->exists(options.second_root))
    job.warn(options.second_root + ": --cache-readonly names no folder; this run does without it");
  options.waiting = [&job, wait = resources.wait_for_cache](const std::string& holder,
                                                            const std::string& path) {
    if (!wait) {
      throw Error(ErrorKind::busy,
                  fmt::format("{}: {} is building this cache pack; run again without --no-wait to "
                              "wait for it, or with --no-cache",
                              path, holder));
    }
    if (!job.waiting) job.waiting = std::make_unique<StageTimer>(job.clock, "wait");
    job.meter.wait("waiting for " + holder);
  };
  return options;
}

/// The cache; nothing, with a warning, if the user did not name it and it cannot be used.
std::unique_ptr<store::StoreFolder> open_cache(const Resources& resources, const std::string& cache,
                                               const std::string& scratch, bool rebuild,
                                               JobContext& job) {
  try {
    auto stores = store::StoreFolder::open_cache(*job.files, cache,
                                                 cache_options(resources, scratch, rebuild, job));
    const store::CacheLayout layout(cache);
    job.hashes = std::make_unique<HashMemo>(*job.files, layout.hash_memo(), layout.parts_folder());
    return stores;
  } catch (const Error& e) {
    // A cache is a convenience: one that nobody asked for by name must not fail a job.
    if (e.kind() != ErrorKind::storage) throw;
    const std::string what = fmt::format("the cache cannot be used: {}", e.what());
    if (!resources.cache_dir.empty()) {
      throw Error(ErrorKind::storage,
                  what + "; choose another folder with --cache, or run with --no-cache");
    }
    job.report.warnings.push_back(
        what + "; this run continues without it (--cache chooses another folder)");
    return nullptr;
  }
}

/// Returns whether there is one more.
bool require_threads(unsigned count) {
  const unsigned obtainable = obtainable_threads(count + 1);
  if (obtainable >= count) return obtainable > count;
  throw Error(
      ErrorKind::storage,
      fmt::format("only {} of {} threads could be created; run with --threads {}, or raise the "
                  "limit (ulimit -u for threads, -v and -d for the memory of their stacks)",
                  obtainable, count, obtainable));
}

void run_attempts(const Resources& resources, JobRun& run,
                  const std::function<void(JobRun&, bool rebuild)>& job) {
  try {
    run.report.version = POUNCE_VERSION;
    return job(run, false);
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::damaged_store || !resources.use_cache) throw;
    // Nothing can be begun again once an image has been composited over itself.
    if (run.painted_in_place) {
      throw Error(ErrorKind::damaged_store,
                  fmt::format("{}; {} outputs were already written: the same command without "
                              "--redo leaves these as they are and goes on with the others",
                              e.what(), run.report.outputs.size()));
    }
  }
  run.meter.restart();
  // What the first attempt wrote is written again, even with --skip-existing, and reported if the
  // second one fails before it comes to it.
  run.written_before.insert(run.report.outputs.begin(), run.report.outputs.end());
  run.report = {};
  run.report.version = POUNCE_VERSION;
  job(run, true);
}

}  // namespace

std::uint64_t budget_bytes(const Resources& resources) {
  return resources.memory_bytes != 0 ? resources.memory_bytes : usable_memory().bytes / 2;
}

std::unique_ptr<JobContext> open_job(const Resources& resources, const std::string& output,
                                     FileSystem* own_files, bool rebuild, bool plan_only,
                                     JobRun& run) {
  auto job = std::make_unique<JobContext>(budget_bytes(resources), run);
  job->threads = thread_count(resources);
  job->plan_only = plan_only;
  job->begins_again = rebuild;
  job->asks_memory = resources.memory_bytes != 0;
  hold_to_limits(*job, {kLeastBudget, "any job"}, 0);
  // Tests: all files in memory, no cache, no account of scratch.
  if (own_files != nullptr) {
    job->files = own_files;
    job->scratch_folder = "/";
    job->stores = store::StoreFolder::make_scratch(*job->files, "/");
    job->scratch = store::StoreFolder::make_scratch(*job->files, "/");
    return job;
  }
  const std::string scratch = scratch_folder(resources, output);
  job->scratch_folder = scratch;
  count_scratch_files(resources, *job);
  job->scratch = store::StoreFolder::make_scratch(*job->files, scratch);
  const std::string cache = !resources.use_cache          ? std::string()
                            : resources.cache_dir.empty() ? default_cache_folder()
                                                          : resources.cache_dir;
  job->cache_folder = plan_only ? "" : cache;
  job->keeps_stores = !cache.empty();
  if (!cache.empty()) job->cache_limit_bytes = cache_limit(resources, cache, *job->files);
  if (!cache.empty() && !plan_only) {
    job->stores = open_cache(resources, cache, scratch, rebuild, *job);
  }
  if (job->stores == nullptr) {
    job->stores = store::StoreFolder::make_scratch(*job->files, scratch);
    job->keeps_stores = job->keeps_stores && plan_only;
  }
  job->check_packs = rebuild;
  if (rebuild) {
    job->report.warnings.push_back(
        cache + ": a damaged pack was found; now every pack that this job uses is checked");
  }
  return job;
}

Report run_job(const Resources& resources, Progress* progress, Report* so_far,
               const std::function<void(JobRun&, bool rebuild)>& job) {
  // Threads of the job's own: what else the process runs keeps its number, and so does this job.
  tbb::task_arena arena(static_cast<int>(thread_count(resources)));
  JobRun run(progress);
  const auto fail = [&](const Error& error) {
    if (so_far == nullptr) return;
    try {
      run.report.failure = Failure{error_kind_name(error.kind()), exit_status(error), error.what()};
      for (const std::string& path : run.report.outputs) run.written_before.erase(path);
      run.report.outputs.insert(run.report.outputs.begin(), run.written_before.begin(),
                                run.written_before.end());
    } catch (const std::bad_alloc&) {
      // No memory for words: what was done is told all the same.
    }
    *so_far = std::move(run.report);
  };
  try {
    with_own_errors([&] {
      instruction_set();  // one that this processor lacks is refused here, not halfway
      run.has_spare_thread = require_threads(thread_count(resources));
      arena.execute([&] {
        try {
          run_attempts(resources, run, job);
        } catch (const Error&) {
          // A signal to a whole group of processes ends a decoder's, too: that is no fault of the
          // image that it was at.
          run.meter.throw_if_cancelled();
          throw;
        }
      });
      run.meter.finish();
      if (so_far != nullptr) *so_far = run.report;
    });
  } catch (const Error& e) {
    fail(e);
    throw;
  }
  return std::move(run.report);
}

void require_least(JobContext& job, const LeastMemory& least, std::uint64_t held_bytes) {
  job.report.least_memory_bytes = least.bytes;
  job.report.least_memory_for = least.why;
  const HeldBudget held = hold_to_limits(job, least, held_bytes);
  if (job.asks_memory && !held.lowered_by.empty()) {
    job.report.warnings.push_back(
        fmt::format("{} is too small for --memory {} and the program: the budget is reduced to {}, "
                    "the result is the same",
                    held.lowered_by, runtime::format_bytes(job.asked_bytes),
                    runtime::format_bytes(held.bytes)));
  }
  if (job.budget.limit() >= least.bytes) return;
  const std::uint64_t mib = (least.bytes + (1 << 20) - 1) >> 20;
  throw Error(ErrorKind::budget,
              fmt::format("--memory {} is too small: this job needs at least {}MiB, for {}; run it "
                          "with --memory {}MiB",
                          runtime::format_bytes(job.budget.limit()), mib, least.why, mib));
}

void require_early(JobContext& job, const LeastMemory& need, std::uint64_t held_bytes) {
  hold_to_limits(job, need, held_bytes);
  // A little more than the budget is read anyway: the message can then state what the whole job
  // needs, not only its first step.
  const std::uint64_t look_anyway = std::min(kLookAnyway, job.room_bytes);
  if (need.bytes > std::max(job.budget.limit(), look_anyway)) require_least(job, need, held_bytes);
}

// --- limits of the process -----------------------------------------------------------------------
//
// A budget is what a job leases. The program and its libraries come on top, and whoever limits the
// process (a container, a scheduler, ulimit) limits the sum.
//
// Two kinds of limits, treated differently (docs/decisions/045-process-need.md). A control group
// kills without a message, so the budget is lowered until the sum fits, or the job is refused with
// the sum that would do. A ulimit refuses memory, which is an error like others: it ends a job
// beforehand only where it is certain to be hit.

namespace {

/// Of a thread beside what it leases: stack, the allocator's arena, the kernel's share.
constexpr std::uint64_t kThreadBytes = 1 << 20;
/// Pages that wait in the page pool (core/page_pool.cpp: 4 and 8 MiB at most), and what libraries
/// take later than this is measured; all of both at once was never seen.
constexpr std::uint64_t kMarginBytes = 12 << 20;

std::uint64_t mib_up(std::uint64_t bytes) { return (bytes + (1 << 20) - 1) >> 20; }

}  // namespace

std::uint64_t beside_budget(std::uint64_t anonymous_bytes, std::uint64_t held_bytes,
                            unsigned threads) {
  return anonymous_bytes - std::min(anonymous_bytes, held_bytes) + threads * kThreadBytes +
         kMarginBytes;
}

HeldBudget budget_under(const std::vector<MemoryLimit>& limits, std::uint64_t asked_bytes,
                        const ProcessNeed& need) {
  HeldBudget budget{asked_bytes, {}};
  for (const MemoryLimit& limit : limits) {
    // A limit that refuses is not reached before what is taken and leased is more than it.
    const std::uint64_t beside =
        limit.kills ? need.beside_bytes
                    : limit.taken_bytes - std::min(limit.taken_bytes, need.held_bytes);
    if (limit.bytes < need.least.bytes || limit.bytes - need.least.bytes < beside) {
      throw Error(
          ErrorKind::budget,
          fmt::format("{} is {}: this job needs at least {}MiB, {}MiB of --memory for {} "
                      "and {}MiB for the program, its libraries and {} threads; raise that "
                      "limit to {}MiB",
                      limit.name, runtime::format_bytes(limit.bytes),
                      mib_up(need.least.bytes + beside), mib_up(need.least.bytes), need.least.why,
                      mib_up(beside), need.threads, mib_up(need.least.bytes + beside)));
    }
    if (limit.kills && limit.bytes - beside < budget.bytes)
      budget = {limit.bytes - beside, limit.name};
  }
  return budget;
}

std::uint64_t bytes_at_once(const JobContext& job) {
  return std::min(job.budget.limit(), usable_memory().bytes);
}

HeldBudget hold_to_limits(JobContext& job, const LeastMemory& least, std::uint64_t held_bytes) {
  // Measured, not assumed: libraries differ between machines. What planning holds already is part
  // of the budget's side and must not count twice.
  const std::uint64_t beside = beside_budget(anonymous_bytes(), held_bytes, job.threads);
  job.report.memory_beside_bytes = beside;
  const std::vector<MemoryLimit> limits = memory_limits();
  HeldBudget budget =
      budget_under(limits, job.asked_bytes, {least, held_bytes, beside, job.threads});
  job.budget.set_limit(budget.bytes);
  for (const MemoryLimit& limit : limits) {
    if (limit.kills) job.room_bytes = limit.bytes - beside;
  }
  return budget;
}

}  // namespace pounce::job
