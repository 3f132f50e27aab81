// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

namespace pounce {

/// Work that was begun and may be under way on another thread. Its destructor waits for it, too.
class BegunWork {
 public:
  BegunWork() = default;
  virtual ~BegunWork() = default;
  BegunWork(const BegunWork&) = delete;
  BegunWork& operator=(const BegunWork&) = delete;

  /// Returns when it is done and throws what it threw. Called once at most.
  virtual void wait() = 0;
};
/// Begins `work`. Null: it is done.
using BeginWork = std::function<std::unique_ptr<BegunWork>(std::function<void()> work)>;
/// Does it here and now.
inline std::unique_ptr<BegunWork> work_here(const std::function<void()>& work) {
  work();
  return nullptr;
}

}  // namespace pounce
