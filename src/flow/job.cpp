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
#include "pounce/version.h"

namespace pounce::flow {
namespace {

unsigned thread_count(const Resources& resources) {
  return resources.threads != 0 ? resources.threads
                                : std::max(1U, std::thread::hardware_concurrency());
}

std::uint64_t budget_bytes(const Resources& resources) {
  return resources.memory_bytes != 0 ? resources.memory_bytes : usable_memory().bytes / 2;
}

std::string cache_folder(const Resources& resources) {
  if (!resources.cache_dir.empty()) return resources.cache_dir;
  const auto from = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr ? std::string(value) : std::string();
  };
  if (const std::string xdg = from("XDG_CACHE_HOME"); !xdg.empty()) return xdg + "/pounce";
  if (const std::string home = from("HOME"); !home.empty()) return home + "/.cache/pounce";
  return {};
}

std::string scratch_folder(const Resources& resources, const std::string& output) {
  if (!resources.temp_dir.empty()) return resources.temp_dir;
  const std::string folder = std::filesystem::path(output).parent_path().string();
  return folder.empty() ? "." : folder;
}

/// A cache that has nothing: what it would hand out is suspect.
class RebuildingFolder : public tiles::StoreFolder {
 public:
  explicit RebuildingFolder(std::unique_ptr<StoreFolder> folder) : folder_(std::move(folder)) {}
  std::unique_ptr<tiles::PackReader> find(tiles::PackKind, const Hash128&, std::string*) override {
    return nullptr;
  }
  std::unique_ptr<tiles::PackWriter> create(tiles::PackKind kind, const Hash128& key) override {
    return folder_->create(kind, key);
  }
  std::unique_ptr<tiles::PackReader> publish(std::unique_ptr<tiles::PackWriter> writer) override {
    return folder_->publish(std::move(writer));
  }
  void discard(tiles::PackKind kind, const Hash128& key) override { folder_->discard(kind, key); }
  bool persistent() const override { return folder_->persistent(); }

 private:
  std::unique_ptr<StoreFolder> folder_;
};

}  // namespace

std::unique_ptr<JobContext> open_job(const Resources& resources, const std::string& output,
                                     bool in_core, bool rebuild, bool plan_only,
                                     Progress* progress) {
  auto job = std::make_unique<JobContext>(budget_bytes(resources), progress);
  job->threads = thread_count(resources);
  if (in_core) {
    job->memory_files = make_memory_file_system();
    job->files = job->memory_files.get();
    job->stores = tiles::StoreFolder::make_scratch(*job->files, "/");
    job->scratch = tiles::StoreFolder::make_scratch(*job->files, "/");
    return job;
  }
  job->files = &posix_file_system();
  const std::string scratch = scratch_folder(resources, output);
  job->scratch = tiles::StoreFolder::make_scratch(*job->files, scratch);
  const std::string cache =
      resources.use_cache && !plan_only ? cache_folder(resources) : std::string();
  if (!cache.empty()) {
    job->stores = tiles::StoreFolder::open_cache(*job->files, cache);
    if (job->stores == nullptr) {
      job->report.warnings.push_back(
          cache + ": in use by another process; this run does without the cache");
    }
  }
  if (job->stores == nullptr) job->stores = tiles::StoreFolder::make_scratch(*job->files, scratch);
  if (rebuild) {
    job->stores = std::make_unique<RebuildingFolder>(std::move(job->stores));
    job->report.warnings.push_back(
        cache + ": a damaged pack was found; everything this job uses is built anew");
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

Report finish_report(JobContext& job) {
  Report& report = job.report;
  report.version = POUNCE_VERSION;
  report.threads = job.threads;
  report.stages = job.clock.times();
  report.memory_budget_bytes = job.budget.limit();
  report.leased_peak_bytes = job.budget.leased_peak();
  report.peak_rss_bytes = peak_rss_bytes();
  return report;
}

}  // namespace pounce::flow
