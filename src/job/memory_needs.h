// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "job/run_job.h"

namespace pounce::job {

/// What the steps of a job need of memory: the one that needs the most decides. Not thread-safe.
class MemoryNeeds {
 public:
  explicit MemoryNeeds(job::JobContext& job) : job_(job) {}

  /// What stays for the whole job is in use beside every step that is added from now on.
  void keep(std::uint64_t bytes) { kept_bytes_ += bytes; }
  void add(std::uint64_t bytes, const std::string& why) {
    const std::uint64_t with_kept = bytes + kept_bytes_;
    if (with_kept > most_.bytes) most_ = {with_kept, why};
  }
  /// The same of a step of planning, which is about to run: throws Error(budget) where it is
  /// hopeless (job::require_early). `held_bytes`: what of it is in memory already.
  void add_now(std::uint64_t bytes, const std::string& why, std::uint64_t held_bytes) {
    add(bytes, why);
    require_early(job_, most_, held_bytes);
  }
  const job::LeastMemory& most() const { return most_; }

 private:
  job::JobContext& job_;
  std::uint64_t kept_bytes_ = 0;
  job::LeastMemory most_;
};

}  // namespace pounce::job
