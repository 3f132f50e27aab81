// SPDX-License-Identifier: Apache-2.0
#include "runtime/waiting_thread.h"

#include <algorithm>
#include <climits>
#include <csignal>
#include <exception>
#include <utility>

namespace pounce::runtime {
namespace {

/// Calls of the system and messages need little. A thread's usual 8 MiB would count against
/// `ulimit -d`, which counts no address space that malloc only reserves.
constexpr std::size_t kStackBytes = 256 << 10;

}  // namespace

class WaitingThread::Task {
 public:
  explicit Task(std::function<void()> work) : work_(std::move(work)) {}

  void run() noexcept {
    try {
      work_();
    } catch (...) {
      error_ = std::current_exception();
    }
    work_ = nullptr;  // what it holds goes with it
  }
  void throw_error() const {
    if (error_) std::rethrow_exception(error_);
  }

  bool is_done = true;  ///< or it was never begun

 private:
  std::function<void()> work_;
  std::exception_ptr error_;
};

std::unique_ptr<BegunWork> WaitingThread::begin(std::function<void()> work) {
  class Begun final : public BegunWork {
   public:
    Begun(WaitingThread& of, std::shared_ptr<Task> task) : of_(of), task_(std::move(task)) {}
    ~Begun() override { wait_for_end(); }
    void wait() override {
      wait_for_end();
      task_->throw_error();
    }

   private:
    void wait_for_end() {
      std::unique_lock lock(of_.mutex_);
      of_.changed_.wait(lock, [this] { return task_->is_done; });
    }

    WaitingThread& of_;
    const std::shared_ptr<Task> task_;
  };

  auto task = std::make_shared<Task>(std::move(work));
  auto begun = std::make_unique<Begun>(*this, task);
  if (has_thread()) {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(task);
    task->is_done = false;
    changed_.notify_all();
  } else {
    task->run();
  }
  return begun;
}

bool WaitingThread::has_thread() {
  if (thread_ || !may_have_one_) return thread_.has_value();
  pthread_attr_t how;
  if (pthread_attr_init(&how) != 0) return false;
  const auto least = static_cast<std::size_t>(PTHREAD_STACK_MIN);
  pthread_attr_setstacksize(&how, std::max(kStackBytes, least));
  pthread_t thread;
  const auto body = [](void* self) -> void* {
    static_cast<WaitingThread*>(self)->run();
    return nullptr;
  };
  // Signals are for the program's own threads.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  if (pthread_create(&thread, &how, body, this) == 0) thread_ = thread;
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_attr_destroy(&how);
  return thread_.has_value();
}

void WaitingThread::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return ends_ || !tasks_.empty(); });
    if (tasks_.empty()) return;
    const std::shared_ptr<Task> task = tasks_.front();
    lock.unlock();
    task->run();
    lock.lock();
    task->is_done = true;
    tasks_.pop_front();
    changed_.notify_all();
  }
}

WaitingThread::~WaitingThread() {
  if (!thread_) return;
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
    changed_.notify_all();
  }
  pthread_join(*thread_, nullptr);
}

}  // namespace pounce::runtime
