// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "core/file.h"
#include "core/timer.h"
#include "flow/hash_memo.h"
#include "flow/memory_budget.h"
#include "pounce/options.h"
#include "pounce/progress.h"
#include "pounce/report.h"
#include "tiles/codec.h"
#include "tiles/store_folder.h"

namespace pounce::flow {

/// Progress of a job as its stages report it: fractions never fall, events are a few a second.
/// Thread-safe.
class Meter {
 public:
  explicit Meter(Progress* progress);
  /// A new stage of `total` units that takes the job's fraction to `end`.
  void begin(const std::string& stage, std::uint64_t total, const std::string& unit, double end);
  /// `units` more are done. Throws Error(cancelled) if the caller asked to stop.
  void advance(std::uint64_t units);
  void end();
  /// Says in between that the job waits, and what for. Throws Error(cancelled) like advance().
  void wait(const std::string& what);
  /// The wait, if there was one, is over: back to the stage.
  void resume();

 private:
  void throw_if_cancelled() const;
  void emit(bool always);

  Progress* progress_;
  std::chrono::steady_clock::time_point start_, last_;
  std::mutex mutex_;
  ProgressEvent event_;
  std::optional<ProgressEvent> interrupted_;  ///< the stage that waits
  double stage_start_ = 0, stage_end_ = 0;
};

/// What every stage of a running job shares.
struct JobContext {
  MemoryBudget budget;
  Meter meter;
  Report report;
  StageClock clock;
  FileSystem* files = nullptr;
  std::unique_ptr<FileSystem> memory_files;     ///< in-core runs
  std::unique_ptr<HashMemo> hashes;             ///< of input files; null without a cache
  std::unique_ptr<tiles::StoreFolder> stores;   ///< source and target stores
  std::unique_ptr<tiles::StoreFolder> scratch;  ///< results; vanish with the process
  std::string scratch_folder;                   ///< for other nameless files
  bool check_packs = false;                     ///< of the cache, whole, before they are believed
  unsigned threads = 1;
  std::uint64_t tile_cap_bytes = 0;
  tbb::enumerable_thread_specific<tiles::Compressor> compressors;

  JobContext(std::uint64_t budget_bytes, Progress* progress)
      : budget(budget_bytes), meter(progress) {}
  tiles::Compressor& compressor() { return compressors.local(); }
  /// A pack that the store has; nothing if the caller is to make it (tiles::StoreFolder::find).
  /// Says in progress and times when it had to wait for another process, and warns of damage.
  std::unique_ptr<tiles::PackReader> find_pack(tiles::PackKind kind, const Hash128& key);

  /// The hash of a part of an input file (size 0 = all of it): remembered, else computed.
  Hash128 content_hash(const std::string& path, std::uint64_t offset, std::uint64_t size_bytes,
                       const std::function<Hash128()>& compute) {
    return hashes ? hashes->get(path, offset, size_bytes, compute) : compute();
  }

  std::unique_ptr<StageTimer> waiting;  ///< while find_pack() waits for another process
};

}  // namespace pounce::flow
