// SPDX-License-Identifier: Apache-2.0
//
// The scratch pack of one step of a job, which the same step of a later run goes on with when this
// one dies: docs/decisions/058-resume.md.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "core/file.h"
#include "core/hash.h"
#include "job/job_context.h"
#include "store/pack/pack.h"

namespace pounce::job {

/// What a step has made so far. It takes the name `.pounce-<key>.resume` in the job's scratch
/// folder once the step has taken a second: steps that are quick leave nothing, however they end.
/// Whoever finds the name taken by a living process works without one. Not thread-safe, but for
/// readers.
class StepPack {
 public:
  /// Of a pack that an earlier run left: takes its chunks in order, and returns false at the first
  /// that means nothing. What belongs together ends with a chunk for which `is_end` is true: only
  /// what is whole is gone on with.
  struct Earlier {
    std::function<bool(store::ChunkKind, const store::ChunkRef&, std::span<const std::byte>)> take;
    std::function<bool(store::ChunkKind)> is_end;
  };
  /// `key`: of all that decides what is in the pack.
  StepPack(JobContext& job, store::PackKind kind, const Hash128& key, const Earlier& earlier);
  ~StepPack();
  StepPack(const StepPack&) = delete;
  StepPack& operator=(const StepPack&) = delete;

  /// What an earlier run left under this key, for whoever only looks; null: nothing.
  static std::unique_ptr<ReadFile> find(JobContext& job, const Hash128& key);
  static bool any_left(JobContext& job);  ///< under any key
  /// Removes that: the step's images are there. Not what somebody is at work on.
  static void remove(JobContext& job, const Hash128& key);

  store::PackWriter& writer() { return *writer_; }
  /// What was appended so far belongs together. From time to time it is handed to the system, and
  /// to the disk.
  void commit();
  /// Reads what was appended so far.
  std::unique_ptr<store::PackReader> reader() const;
  bool is_kept() const { return is_kept_; }  ///< it has its name
  /// Counts bytes of the pack that only a later run needs; false, and nothing is counted: this job
  /// may need their room itself.
  bool take_spare(std::uint64_t bytes);
  /// No later run needs it: the step's images are there, or what it is made from is damaged.
  void forget() noexcept;

 private:
  using Clock = std::chrono::steady_clock;

  void go_on(std::unique_ptr<ResumableFile> file, const Earlier& earlier);
  void begin();
  void keep();
  void note_folder(const std::string& folder) const;

  JobContext& job_;
  const store::PackKind kind_;
  const Hash128 key_;
  const std::string name_;
  ResumableFile* file_ = nullptr;  ///< the writer's; null: it is an ordinary scratch file
  std::unique_ptr<store::PackWriter> writer_;
  bool is_kept_ = false;
  std::uint64_t spare_taken_ = 0;
  const Clock::time_point begun_ = Clock::now();
  Clock::time_point flushed_ = begun_, synced_ = begun_;
};

}  // namespace pounce::job
