// SPDX-License-Identifier: Apache-2.0
//
// A folder that all tasks of a job see: what the job is, parts of images, and how each task stands
// (docs/farm.md). There is no program that keeps it: whoever reads it learns all from its files.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pounce/option_table.h"
#include "pounce/progress.h"
#include "pounce/report.h"

namespace pounce::cli {

/// How a task stands, as it says itself.
struct TaskState {
  std::string name;   ///< "prepare", "assemble", or the number of a task
  std::string state;  ///< "running", "done", "failed", "stopped"; of readers: "lost", "missing"
  std::string host;   ///< where it runs or ran
  std::int64_t process = 0;
  std::string scheduler;           ///< its number there, such as "slurm 12_3"; may be empty
  double begun_s = 0, seen_s = 0;  ///< since 1970
  double fraction = 0;             ///< that is done
  std::string stage;
  std::uint64_t resident_bytes = 0;  ///< at most
  double cpu_s = 0;
  std::uint64_t texels = 0, covered = 0, outputs = 0;
  int exit_status = 0;
  std::string message;  ///< why it ended, where it failed
};

class JobFolder {
 public:
  explicit JobFolder(std::string path) : path_(std::move(path)) {}

  const std::string& path() const { return path_; }
  std::string job_path() const { return path_ + "/job.json"; }
  bool has_job() const;
  /// How many tasks share the job. Throws Error(input), Error(storage).
  std::uint32_t tasks() const;
  /// Makes the folder for this job, or makes sure that it is for this one: throws Error(usage)
  /// where it is for another, or for another number of tasks.
  void be_for(const std::string& command, const std::vector<OptionReport>& options,
              std::uint32_t tasks) const;

  void save(const TaskState& state) const;
  /// Nothing if it has never begun.
  std::optional<TaskState> task(const std::string& name) const;
  /// As task(), and what its file cannot say: that it has gone, or never was.
  TaskState look_at(const std::string& name) const;
  /// It has to be done again.
  void forget(const std::string& name) const;

  /// A file of this folder; nothing if there is none.
  std::optional<std::string> read(const std::string& name) const;
  /// Writes a file of this folder, which appears whole, and stays so when the power fails. Throws
  /// Error(storage).
  void write(const std::string& name, const std::string& text) const;
  /// Removes what processes of this machine left that died while they wrote such a file.
  void sweep_drafts(const std::string& name) const;

 private:
  void replace(const std::string& name, const std::string& text, bool synced) const;

  std::string path_;
};

/// What a running task says of itself in its folder, every few seconds. Not thread-safe: the
/// library makes one call at a time.
class TaskLog {
 public:
  TaskLog(JobFolder folder, std::string name);
  void event(const ProgressEvent& event);
  void end(const Report& report, int exit_status, const std::string& message);

 private:
  void save();

  const JobFolder folder_;
  TaskState state_;
  double saved_s_ = 0;
  bool is_told_ = false;   ///< that nothing can be said
  bool is_again_ = false;  ///< it was done before: nothing less is said of it
};

/// This machine.
std::string host_name();
/// Since 1970.
double seconds_now();

}  // namespace pounce::cli
