// SPDX-License-Identifier: Apache-2.0
#include "runtime/block_cache.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

using namespace pounce;

namespace {

/// Blocks are their own numbers; reading one waits until `may_end`.
struct Slow {
  using Index = std::vector<std::uint64_t>;
  using Entry = std::uint64_t;
  using Block = std::uint64_t;
  static constexpr bool kReadsAlone = true;
  static constexpr runtime::Reuse reuse = runtime::Reuse::anywhere;

  struct Progress {
    std::atomic<int> read{0};
    std::promise<void> promise;
    std::shared_future<void> may_end = promise.get_future().share();
    bool fails = false;
  };
  std::shared_ptr<Progress> progress;

  static Index read_index(std::uint32_t) { return {}; }
  static std::uint64_t index_bytes(const Index&) { return 1; }
  Block read_block(const Entry& entry) const {
    ++progress->read;
    progress->may_end.wait();
    if (progress->fails) throw std::runtime_error("unreadable");
    return entry;
  }
  static std::uint64_t block_bytes(const Entry&) { return 10; }
  static std::uint64_t index_place(std::uint32_t part) { return std::uint64_t{part} * 8; }
  static std::uint64_t place(const Entry& entry) { return entry * 8; }
};

}  // namespace

TEST_CASE("threads that ask for one block at once share what the first of them reads") {
  // Kept by the cache afterwards, and not: there is no room for anything.
  const std::uint64_t limit = GENERATE(100U, 0U);
  runtime::MemoryBudget budget(limit);
  const auto progress = std::make_shared<Slow::Progress>();
  progress->fails = GENERATE(false, true);
  const runtime::BlockCache<Slow> cache(budget, {progress});
  std::vector<std::future<std::shared_ptr<const std::uint64_t>>> asked;
  for (int thread = 0; thread < 4; ++thread)
    asked.push_back(std::async(std::launch::async, [&] { return cache.block(7); }));
  while (progress->read == 0) std::this_thread::yield();
  // The others wait by now, or will find it done: in neither case do they read while it is read.
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  CHECK(progress->read == 1);
  // What is not asked for is not waited for.
  auto other = std::async(std::launch::async, [&] { return cache.block(8); });
  while (progress->read < 2) std::this_thread::yield();
  progress->promise.set_value();
  for (auto& one : asked) {
    if (progress->fails) {
      CHECK_THROWS_AS(one.get(), std::runtime_error);
    } else {
      CHECK(*one.get() == 7);
    }
  }
  if (progress->fails) {
    CHECK_THROWS_AS(other.get(), std::runtime_error);
    progress->fails = false;  // whoever asks then reads
  } else {
    CHECK(*other.get() == 8);
  }
  CHECK(*cache.block(7) == 7);
  CHECK((cache.kept_block(7) != nullptr) == (limit > 0));
}
