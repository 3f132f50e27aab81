// SPDX-License-Identifier: Apache-2.0
#include "flow/job.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "core/system_memory.h"
#include "pounce/cache.h"
#include "pounce/version.h"
#include "tiles/cache_layout.h"

namespace pounce::flow {
namespace {

/// A mesh whose reading takes no more than this is read even if the budget is smaller, to say
/// exactly how much the job needs.
constexpr std::uint64_t kReadAnyway = 64ULL << 20;

unsigned thread_count(const Resources& resources) {
  return resources.threads != 0 ? resources.threads
                                : std::max(1U, std::thread::hardware_concurrency());
}

std::uint64_t budget_bytes(const Resources& resources) {
  return resources.memory_bytes != 0 ? resources.memory_bytes : usable_memory().bytes / 2;
}

/// The output's folder; of a pattern that has tokens in its folders, the one above them all.
std::string scratch_folder(const Resources& resources, const std::string& output) {
  if (!resources.temp_dir.empty()) return resources.temp_dir;
  std::filesystem::path folder = std::filesystem::path(output).parent_path();
  while (folder.string().find('<') != std::string::npos && folder.has_relative_path())
    folder = folder.parent_path();
  return folder.empty() ? "." : folder.string();
}

/// How this job deals with the other users of its cache.
tiles::CacheOptions cache_options(const Resources& resources, const std::string& cache,
                                  const std::string& scratch, bool rebuild, JobContext& job) {
  tiles::CacheOptions options;
  options.limit_bytes = resources.cache_limit_bytes ? *resources.cache_limit_bytes
                                                    : tiles::default_limit_bytes(*job.files, cache);
  options.scratch_folder = scratch;
  options.verify = rebuild;
  options.waiting = [&job, wait = resources.wait_for_cache](const std::string& holder,
                                                            const std::string& path) {
    if (!wait) {
      throw Error(ErrorKind::busy,
                  fmt::format("{}: {} is making this pack of the cache; run again without "
                              "--no-wait to wait for it, or with --no-cache",
                              path, holder));
    }
    if (!job.waiting) job.waiting = std::make_unique<StageTimer>(job.clock, "wait");
    job.meter.wait("waiting for " + holder);
  };
  return options;
}

/// The cache; nothing, with a warning, if the user did not name it and it cannot be used.
std::unique_ptr<tiles::StoreFolder> open_cache(const Resources& resources, const std::string& cache,
                                               const std::string& scratch, bool rebuild,
                                               JobContext& job) {
  try {
    auto stores = tiles::StoreFolder::open_cache(
        *job.files, cache, cache_options(resources, cache, scratch, rebuild, job));
    const tiles::CacheLayout layout(cache);
    job.hashes = std::make_unique<HashMemo>(*job.files, layout.hash_memo(), layout.parts_folder());
    return stores;
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::storage) throw;
    const std::string what = fmt::format("the cache cannot be used: {}", e.what());
    if (!resources.cache_dir.empty()) {
      throw Error(ErrorKind::storage,
                  what + "; give another folder with --cache, or run with --no-cache");
    }
    job.report.warnings.push_back(what + "; this run does without (--cache names another folder)");
    return nullptr;
  }
}

}  // namespace

std::unique_ptr<JobContext> open_job(const Resources& resources, const std::string& output,
                                     bool in_core, bool rebuild, bool plan_only,
                                     Progress* progress) {
  auto job = std::make_unique<JobContext>(budget_bytes(resources), progress);
  job->threads = thread_count(resources);
  if (in_core) {
    job->memory_files = make_memory_file_system();
    job->files = job->memory_files.get();
    job->scratch_folder = "/";
    job->stores = tiles::StoreFolder::make_scratch(*job->files, "/");
    job->scratch = tiles::StoreFolder::make_scratch(*job->files, "/");
    return job;
  }
  job->files = &posix_file_system();
  const std::string scratch = scratch_folder(resources, output);
  job->scratch_folder = scratch;
  job->scratch = tiles::StoreFolder::make_scratch(*job->files, scratch);
  const std::string cache = !resources.use_cache || plan_only ? std::string()
                            : resources.cache_dir.empty()     ? default_cache_folder()
                                                              : resources.cache_dir;
  if (!cache.empty()) {
    job->stores = open_cache(resources, cache, scratch, rebuild, *job);
  }
  if (job->stores == nullptr) job->stores = tiles::StoreFolder::make_scratch(*job->files, scratch);
  job->check_packs = rebuild;
  if (rebuild) {
    job->report.warnings.push_back(
        cache + ": a damaged pack was found; every pack that this job uses is checked");
  }
  return job;
}

Report run_job(const Resources& resources, const std::function<Report(bool rebuild)>& job) {
  tbb::task_arena arena(static_cast<int>(thread_count(resources)));
  const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism,
                                            std::max<std::size_t>(thread_count(resources), 1));
  return arena.execute([&] {
    try {
      return job(false);
    } catch (const Error& e) {
      if (e.kind() != ErrorKind::damaged_store || !resources.use_cache) throw;
    }
    return job(true);
  });
}

void require_least(JobContext& job, const LeastMemory& least) {
  job.report.least_memory_bytes = least.bytes;
  if (job.budget.limit() >= least.bytes) return;
  const std::uint64_t mib = (least.bytes + (1 << 20) - 1) >> 20;
  throw Error(ErrorKind::budget,
              fmt::format("--memory {} is too small: this job needs at least {}MiB, for {}; run it "
                          "with --memory {}MiB",
                          format_bytes(job.budget.limit()), mib, least.why, mib));
}

void require_reading(JobContext& job, std::uint64_t bytes, const std::string& path) {
  if (bytes > std::max(job.budget.limit(), kReadAnyway))
    require_least(job, {bytes + kReadAnyway, "reading " + path});
}

Report finish_report(JobContext& job) {
  Report& report = job.report;
  report.version = POUNCE_VERSION;
  report.threads = job.threads;
  report.stages = job.clock.times();
  for (StageTime& stage : report.stages) {
    if (stage.name == "decode") stage.cached = report.images_decoded == 0;
  }
  for (std::string& note : job.stores->take_notes()) report.warnings.push_back(std::move(note));
  report.memory_budget_bytes = job.budget.limit();
  report.leased_peak_bytes = job.budget.leased_peak();
  report.peak_rss_bytes = peak_rss_bytes();
  return report;
}

}  // namespace pounce::flow
