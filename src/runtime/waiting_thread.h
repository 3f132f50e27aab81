// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pthread.h>

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "core/begun_work.h"

namespace pounce::runtime {

/// A thread beside those of a job, for calls in which the system is waited for and no processor
/// works, as fsync(). It is there from the first work on. Where there is none to be had the work is
/// done by whoever begins it. begin() is not thread-safe.
class WaitingThread {
 public:
  /// `may_have_one`: false where the system is known to have none to give.
  explicit WaitingThread(bool may_have_one = true) : may_have_one_(may_have_one) {}
  ~WaitingThread();  ///< once all that was begun is done
  WaitingThread(const WaitingThread&) = delete;
  WaitingThread& operator=(const WaitingThread&) = delete;

  /// Begins `work` when all that was begun before is done. What it returns must not outlive this.
  std::unique_ptr<BegunWork> begin(std::function<void()> work);

 private:
  class Task;

  bool has_thread();
  void run();

  const bool may_have_one_;
  std::mutex mutex_;  // guards all below but thread_, and what tasks have done
  std::condition_variable changed_;
  std::deque<std::shared_ptr<Task>> tasks_;  ///< the first is under way
  bool ends_ = false;
  std::optional<pthread_t> thread_;
};

}  // namespace pounce::runtime
