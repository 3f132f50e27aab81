// SPDX-License-Identifier: Apache-2.0
#include "runtime/shared_work.h"

#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <utility>

#include "pounce/error.h"

namespace pounce::runtime {
namespace {

/// Work that any thread of the job may take. Who waits for it works meanwhile.
class SharedWork final : public BegunWork {
 public:
  explicit SharedWork(std::function<void()> work) {
    group_.run([this, work = std::move(work)] {
      work();
      done_ = true;
    });
  }
  ~SharedWork() noexcept override {
    if (waited_) return;
    try {
      group_.wait();
    } catch (...) {  // of what nobody waits for any more
    }
  }
  void wait() override {
    waited_ = true;
    group_.wait();
    // Where the job has ended with an error, TBB drops what was not begun without a word.
    if (!done_) throw Error(ErrorKind::cancelled, "a piece of work was not begun");
  }

 private:
  tbb::task_group group_;
  bool done_ = false, waited_ = false;
};

}  // namespace

std::unique_ptr<BegunWork> begin_work(std::function<void()> work) {
  if (tbb::this_task_arena::max_concurrency() == 1) return work_here(work);
  return std::make_unique<SharedWork>(std::move(work));
}

}  // namespace pounce::runtime
