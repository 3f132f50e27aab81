// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/file.h"
#include "core/input_file.h"
#include "core/page_pool.h"
#include "core/timer.h"
#include "job/hash_memo.h"
#include "pounce/options.h"
#include "pounce/report.h"
#include "runtime/memory_budget.h"
#include "runtime/meter.h"
#include "store/cache/store_folder.h"
#include "store/pack/codec.h"

namespace pounce::job {

/// What asks for the most memory, and how much the whole job needs at least.
struct LeastMemory {
  std::uint64_t bytes = 0;
  std::string why;
};

/// What the caller sees of a job. It outlives the attempts: a job begins again when its stores
/// turn out to be damaged.
struct JobRun {
  runtime::Meter meter;
  Report report;
  /// Outputs of an attempt before this one: made again, whatever --skip-existing says.
  std::set<std::string> written_before;
  /// An image took the place of what it was painted onto: no attempt may paint it again.
  bool painted_in_place = false;
  /// Beside those of the job the system has a thread to give, for what only waits.
  bool has_spare_thread = true;
  explicit JobRun(Progress* progress) : meter(progress) {}
};

/// What every stage of a running job shares. When it goes, however the job ends, the report gets
/// what is only known then.
struct JobContext {
  JobRun& run;
  runtime::MemoryBudget budget;
  /// From 32 MiB on a job is taken to need a huge page.
  ExpectedUse expected_use;
  const std::uint64_t asked_bytes;  ///< the budget before the process's limits lower it
  bool asks_memory = false;         ///< the user named that
  /// What a control group leaves for the budget; all there is without one.
  std::uint64_t room_bytes = std::numeric_limits<std::uint64_t>::max();
  runtime::Meter& meter;
  Report& report;
  StageClock clock;
  InputFiles inputs;
  FileSystem* files = nullptr;
  std::unique_ptr<FileSystem> counted_files;        ///< what `files` is, but for tests
  std::unique_ptr<HashMemo> hashes;                 ///< of input files; null without a cache
  std::unique_ptr<store::StoreFolder> stores;       ///< source and target stores
  std::unique_ptr<store::StoreFolder> scratch;      ///< results; vanish with the process
  std::shared_ptr<ScratchAccount> scratch_account;  ///< of all nameless files; null in memory
  std::string scratch_folder;                       ///< of all nameless files
  std::string parts_folder;  ///< of parts of images, which tasks leave for each other; "": none
  bool check_packs = false;  ///< of the cache, whole, before they are believed
  unsigned threads = 1;
  std::string cache_folder;  ///< "" without a cache
  bool plan_only = false;
  bool begins_again = false;      ///< an attempt before this one met a damaged pack
  bool merges_materials = false;  ///< of a source mesh, into one of the target that is made of it
  /// How long a step takes before what it has made is kept for a later run.
  std::chrono::milliseconds keeps_results_after = std::chrono::seconds(1);
  bool keeps_pages = true;                ///< hits and results of this page go into the cache
  bool keeps_stores = false;              ///< stores go into the cache (of a plan: would go)
  std::uint64_t cache_limit_bytes = 0;    ///< then: what the cache may take; 0 = no limit
  std::uint64_t scratch_limit_bytes = 0;  ///< of all scratch files together; 0 = no limit
  /// What is left of that for what only a later run needs: without it this one must not fail.
  std::uint64_t spare_scratch_bytes = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t tile_cap_bytes = 0;
  tbb::enumerable_thread_specific<store::Compressor> compressors;
  store::PlainRoom plain_room = 0;  ///< of scratch that is not worth compressing

  JobContext(std::uint64_t budget_bytes, JobRun& of_run)
      : run(of_run),
        budget(budget_bytes),
        expected_use(budget_bytes / 16),
        asked_bytes(budget_bytes),
        meter(of_run.meter),
        report(of_run.report) {}
  ~JobContext();
  JobContext(const JobContext&) = delete;
  JobContext& operator=(const JobContext&) = delete;

  /// For nameless files.
  ScratchFolder scratch_place() const { return {files, scratch_folder}; }
  store::Compressor& compressor() { return compressors.local(); }
  /// What may be stored as it is of scratch, and of stores, which a cache keeps small.
  store::PlainRoom* scratch_room() { return &plain_room; }
  store::PlainRoom* stores_room() { return stores->persistent() ? nullptr : &plain_room; }
  /// A pack that the store has; nothing if the caller is to make it (store::StoreFolder::find).
  /// Says in progress and times when it had to wait for another process, and warns of damage.
  std::unique_ptr<store::PackReader> find_pack(store::PackKind kind, const Hash128& key);

  /// Says in the report what a user should know; nothing where the text is empty.
  void warn(const std::string& text) {
    if (!text.empty()) report.warnings.push_back(text);
  }
  void note(const std::string& text) {
    std::vector<std::string>& notes = report.notes;  // two parts of a job may find the same
    if (!text.empty() && std::find(notes.begin(), notes.end(), text) == notes.end())
      notes.push_back(text);
  }

  /// Counts a store that the job goes on with; `cached`: it was there already.
  void count_store(const store::PackReader& pack, bool cached);

  /// The hash of a part of an input file (size 0 = all of it): remembered, else computed.
  Hash128 content_hash(const std::string& path, std::uint64_t offset, std::uint64_t size_bytes,
                       const std::function<Hash128()>& compute) {
    const bool may_remember = hashes != nullptr && is_input_in_place(path);
    return may_remember ? hashes->get(path, offset, size_bytes, compute) : compute();
  }

  std::unique_ptr<StageTimer> waiting;  ///< while find_pack() waits for another process
  /// Held by whoever makes a store while a projection's graph runs: one at a time. It guards also
  /// what making one writes of the job, its report among it: while a graph runs nothing else writes
  /// that (docs/decisions/033). Making one may need another to be made.
  std::recursive_mutex making;
};

/// The hash of a whole input file: remembered, else read in pieces.
Hash128 file_hash(JobContext& job, const std::string& path);

/// What these files take; of what is not there nothing.
std::uint64_t size_on_disk(const std::vector<std::string>& files);

/// Publishes a scratch pack that nobody looks for by its key. There is one of a kind at a time: it
/// takes the place of the one before, whose room is free once its last reader is gone.
std::unique_ptr<store::PackReader> publish_scratch(JobContext& job,
                                                   std::unique_ptr<store::PackWriter> writer);

/// When it goes, so does the scratch pack of its kind and key.
class ScratchPack {
 public:
  ScratchPack(JobContext& job, store::PackKind kind, const Hash128& key = {})
      : job_(job), kind_(kind), key_(key) {}
  ~ScratchPack();
  ScratchPack(const ScratchPack&) = delete;
  ScratchPack& operator=(const ScratchPack&) = delete;

 private:
  JobContext& job_;
  store::PackKind kind_;
  Hash128 key_;
};

}  // namespace pounce::job
