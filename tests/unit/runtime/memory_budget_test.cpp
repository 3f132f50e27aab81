// SPDX-License-Identifier: Apache-2.0
#include "runtime/memory_budget.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <thread>
#include <vector>

#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::runtime;
using pounce::test::Random;

namespace {

std::shared_ptr<const void> thing() { return std::make_shared<int>(1); }

}  // namespace

TEST_CASE("leases add up to the limit and not a byte further") {
  runtime::MemoryBudget budget(100);
  CHECK(budget.try_lease(60));
  CHECK_FALSE(budget.try_lease(41));
  CHECK(budget.try_lease(40));
  CHECK(budget.try_lease(0));
  CHECK_FALSE(budget.try_lease(1));
  CHECK_FALSE(budget.try_lease(UINT64_MAX));  // no overflow
  budget.release(60);
  CHECK(budget.leased() == 40);
  CHECK(budget.try_lease(60));
  CHECK(budget.leased_peak() == 100);
}

TEST_CASE("a lease that does not fit says how much would") {
  runtime::MemoryBudget budget(3 << 20);
  const runtime::Lease first(budget, 1 << 20, "the first");
  std::string message;
  CHECK(
      test::error_kind([&] { const runtime::Lease second(budget, 5 << 20, "a very large image"); },
                       &message) == static_cast<int>(ErrorKind::budget));
  CHECK(message.find("a very large image") != std::string::npos);
  CHECK(message.find("3.0 MiB") != std::string::npos);
  CHECK(message.find("6MiB") != std::string::npos);
  CHECK(budget.leased() == 1 << 20);
}

TEST_CASE("a lease ends with its object, also when moved") {
  runtime::MemoryBudget budget(100);
  {
    runtime::Lease a(budget, 10, "a");
    runtime::Lease b = std::move(a);
    CHECK(budget.leased() == 10);
    runtime::Lease c(budget, 20, "c");
    c = std::move(b);
    CHECK(c.bytes() == 10);
    c = {};
    CHECK(c.bytes() == 0);
  }
  CHECK(budget.leased() == 0);
}

TEST_CASE("the least recently used thing goes first when a lease asks for room") {
  runtime::MemoryBudget budget(100);
  for (std::uint64_t item = 0; item < 4; ++item) budget.keep({1, item}, thing(), 25);
  CHECK(budget.find({1, 0}) != nullptr);  // now the most recent
  CHECK(budget.try_lease(1));
  CHECK(budget.find({1, 1}) == nullptr);
  CHECK(budget.find({1, 2}) != nullptr);
  CHECK(budget.try_lease(49));  // 50 leased beside 75: one more goes, and it is item 3
  CHECK(budget.find({1, 3}) == nullptr);
  CHECK(budget.find({1, 0}) != nullptr);
  CHECK(budget.find({1, 2}) != nullptr);
  budget.keep({1, 4}, thing(), 25);  // pushes 0 out: 2 was asked for later
  CHECK(budget.find({1, 0}) == nullptr);
  CHECK(budget.find({1, 2}) != nullptr);
  CHECK(budget.find({1, 4}) != nullptr);
  CHECK(budget.leased_peak() == 100);
}

TEST_CASE("among many things those that are asked for stay, and others go in their order") {
  runtime::MemoryBudget budget(64);
  for (std::uint64_t item = 0; item < 64; ++item) budget.keep({1, item}, thing(), 1);
  for (std::uint64_t round = 0; round < 500; ++round) {
    for (const std::uint64_t hot : {10, 3, 10, 40}) CHECK(budget.find({1, hot}) != nullptr);
    if (round % 3 == 0) budget.keep({1, 1000 + round}, thing(), 1);  // one of the others goes
  }
  // 167 came, so the last 61 of them are there beside the three.
  for (std::uint64_t round = 0; round < 500; round += 3)
    CHECK((budget.find({1, 1000 + round}) != nullptr) == (round / 3 >= 167 - 61));
}

TEST_CASE("what does not fit beside the leases is not kept, what is kept is kept once") {
  runtime::MemoryBudget budget(100);
  CHECK(budget.try_lease(70));
  budget.keep({1, 1}, thing(), 31);
  CHECK(budget.find({1, 1}) == nullptr);
  const auto first = thing();
  budget.keep({1, 1}, first, 30);
  budget.keep({1, 1}, thing(), 30);  // somebody decoded it meanwhile
  CHECK(budget.find({1, 1}) == first);
  CHECK_FALSE(budget.try_lease(31));
  CHECK(budget.find({1, 1}) == first);  // a lease in vain costs nothing
  CHECK(budget.try_lease(30));
  CHECK(budget.find({1, 1}) == nullptr);
  CHECK(first.use_count() == 1);
}

constexpr std::uint64_t kMiB = 1ULL << 20;

/// Asks for `count` things of 1 MiB in turn, makes those that are gone, and says how many.
std::uint64_t go_through(runtime::MemoryBudget& budget, std::uint64_t count) {
  std::uint64_t made = 0;
  for (std::uint64_t item = 0; item < count; ++item) {
    if (budget.find({1, item}) != nullptr) continue;
    budget.keep({1, item}, thing(), kMiB, runtime::Reuse::near);
    ++made;
  }
  return made;
}

TEST_CASE("what only neighbours ask for is kept for a while, however much room there is") {
  static_assert(runtime::MemoryBudget::kNearBytes == 4 * kMiB);
  runtime::MemoryBudget budget(1000 * kMiB);
  budget.keep({2, 0}, thing(), 50 * kMiB);
  CHECK(go_through(budget, 4) == 4);
  CHECK(budget.find({1, 0}) != nullptr);  // now the most recent
  budget.keep({1, 4}, thing(), kMiB, runtime::Reuse::near);
  CHECK(budget.find({1, 1}) == nullptr);
  CHECK(budget.find({1, 0}) != nullptr);
  CHECK(budget.find({1, 4}) != nullptr);
  CHECK(budget.find({2, 0}) != nullptr);
  CHECK(budget.leased_peak() == 54 * kMiB);
}

TEST_CASE("what is asked for again and again is made twice at most") {
  runtime::MemoryBudget budget(100 * kMiB);
  CHECK(go_through(budget, 40) == 40);
  CHECK(go_through(budget, 40) == 36);  // for each of these one more is kept from now on
  CHECK(go_through(budget, 40) == 0);
  CHECK(budget.leased_peak() == 40 * kMiB);
}

TEST_CASE("what was passed of a store that is closed is not taken for the next one's") {
  runtime::MemoryBudget budget(100 * kMiB);
  for (int round = 0; round < 3; ++round) {
    const std::uint64_t store = budget.new_store();
    for (std::uint64_t item = 0; item < 8; ++item)
      budget.keep({store, item}, thing(), kMiB, runtime::Reuse::near);
    CHECK(budget.find({store, 3}) == nullptr);
    CHECK(budget.find({store, 4}) != nullptr);
    budget.forget(store);
  }
}

TEST_CASE("one thing larger than what is kept near is kept alone") {
  runtime::MemoryBudget budget(100 * kMiB);
  go_through(budget, 2);
  budget.keep({2, 0}, thing(), 20 * kMiB, runtime::Reuse::near);
  CHECK(budget.find({2, 0}) != nullptr);
  CHECK(budget.find({1, 1}) == nullptr);
}

TEST_CASE("a lease takes the room of what was used longest ago, of either kind") {
  runtime::MemoryBudget budget(100);
  budget.keep({1, 0}, thing(), 25, runtime::Reuse::near);
  budget.keep({1, 1}, thing(), 25);
  budget.keep({1, 2}, thing(), 25, runtime::Reuse::near);
  budget.keep({1, 3}, thing(), 25);
  CHECK(budget.find({1, 0}) != nullptr);
  CHECK(budget.try_lease(25));
  CHECK(budget.find({1, 1}) == nullptr);
  CHECK(budget.try_lease(25));
  CHECK(budget.find({1, 2}) == nullptr);
  CHECK(budget.try_lease(25));
  CHECK(budget.find({1, 3}) == nullptr);
  CHECK(budget.try_lease(25));
  CHECK(budget.find({1, 0}) == nullptr);
}

TEST_CASE("bytes of a store that was forgotten are near no more") {
  runtime::MemoryBudget budget(100 * kMiB);
  go_through(budget, 4);
  budget.forget(1);
  for (std::uint64_t item = 0; item < 4; ++item)
    budget.keep({2, item}, thing(), kMiB, runtime::Reuse::near);
  CHECK(budget.find({2, 0}) != nullptr);
  budget.forget_all();
  CHECK(go_through(budget, 4) == 4);
  CHECK(budget.find({1, 0}) != nullptr);
}

TEST_CASE("forgetting a store leaves the others alone and frees its bytes") {
  runtime::MemoryBudget budget(100);
  std::weak_ptr<const void> gone;
  for (std::uint64_t item = 0; item < 5; ++item) {
    const auto a = thing();
    if (item == 2) gone = a;
    budget.keep({7, item}, a, 10);
    budget.keep({8, item}, thing(), 10);
  }
  budget.forget(7);
  CHECK(gone.expired());
  for (std::uint64_t item = 0; item < 5; ++item) {
    CHECK(budget.find({7, item}) == nullptr);
    CHECK(budget.find({8, item}) != nullptr);
  }
  for (std::uint64_t item = 0; item < 5; ++item) budget.keep({9, item}, thing(), 10);
  CHECK(budget.find({8, 0}) != nullptr);  // there was room for the new ones
}

TEST_CASE("forgetting all frees every store's bytes and no lease") {
  runtime::MemoryBudget budget(100);
  std::vector<std::weak_ptr<const void>> gone;
  for (std::uint64_t item = 0; item < 8; ++item) {
    const auto kept = thing();
    gone.emplace_back(kept);
    budget.keep({7 + item % 2, item}, kept, 10);
  }
  CHECK(budget.try_lease(20));
  budget.forget_all();
  for (const auto& each : gone) CHECK(each.expired());
  CHECK(budget.find({7, 0}) == nullptr);
  CHECK(budget.leased() == 20);
  budget.forget(7);  // as a store does when it closes later
  for (std::uint64_t item = 0; item < 8; ++item) budget.keep({7, item}, thing(), 10);
  for (std::uint64_t item = 0; item < 8; ++item) CHECK(budget.find({7, item}) != nullptr);
  CHECK_FALSE(budget.try_lease(81));
  CHECK(budget.try_lease(80));
}

TEST_CASE("from several threads leases and cache stay within the limit") {
  runtime::MemoryBudget budget(1000);
  std::atomic<std::uint64_t> leased = 0;
  std::atomic<bool> exceeded = false;
  std::vector<std::thread> threads;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    threads.emplace_back([&, seed] {
      Random random(seed);
      for (int i = 0; i < 20000; ++i) {
        const std::uint64_t bytes = random.below(400);
        const runtime::CacheKey key{random.below(3), random.below(50)};
        if (random.one_in(2)) budget.keep(key, thing(), 1 + random.below(200));
        if (random.one_in(50)) budget.forget(key.store);
        if (random.one_in(200)) budget.forget_all();
        budget.find(key);
        if (!budget.try_lease(bytes)) continue;
        if (leased.fetch_add(bytes) + bytes > 1000) exceeded = true;
        leased.fetch_sub(bytes);
        budget.release(bytes);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK_FALSE(exceeded);
  CHECK(budget.leased() == 0);
  CHECK(budget.leased_peak() <= 1000);
  CHECK(budget.leased_peak() > 900);
}

TEST_CASE("bytes are written the way people read them") {
  CHECK(runtime::format_bytes(0) == "0 B");
  CHECK(runtime::format_bytes(1023) == "1023 B");
  CHECK(runtime::format_bytes(1536) == "1.5 KiB");
  CHECK(runtime::format_bytes(13107200) == "12.5 MiB");
  CHECK(runtime::format_bytes(5ULL << 29) == "2.50 GiB");
}
