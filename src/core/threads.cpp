// SPDX-License-Identifier: Apache-2.0
#include "core/threads.h"

#include <pthread.h>

#include <mutex>
#include <vector>

namespace pounce {

unsigned obtainable_threads(unsigned wanted) {
  std::mutex gate;  // holds the threads until all of them are there
  std::vector<pthread_t> threads;
  threads.reserve(wanted);
  {
    const std::lock_guard closed(gate);
    const auto wait = [](void* opaque) -> void* {
      const std::lock_guard passed(*static_cast<std::mutex*>(opaque));
      return nullptr;
    };
    pthread_t thread;
    while (threads.size() + 1 < wanted && pthread_create(&thread, nullptr, wait, &gate) == 0)
      threads.push_back(thread);
  }
  for (const pthread_t thread : threads) pthread_join(thread, nullptr);
  return static_cast<unsigned>(threads.size()) + 1;
}

}  // namespace pounce
