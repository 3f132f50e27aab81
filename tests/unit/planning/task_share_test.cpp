// SPDX-License-Identifier: Apache-2.0
//
// Who makes what: worked out by hand for a few images, and looked at as a whole for many.
#include "planning/task_share.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <numeric>
#include <set>

#include "pounce/error.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::planning;
using Tasks = std::vector<std::uint32_t>;

namespace {

std::vector<WorkUnit> units_of(const std::vector<double>& costs) {
  std::vector<WorkUnit> units;
  for (const double cost : costs) units.push_back({cost, false});
  return units;
}

}  // namespace

TEST_CASE("whole images go to whoever has the least, the largest first") {
  // 7 > 6 > 5 > 4 > 3: tasks 1, 2, then 2 has 6+5 = 11 for 7+4 = 11, so 3 goes to the first of
  // equals.
  const auto units = units_of({3, 6, 7, 4, 5});
  const auto shares = share_out(units, 2, false);
  CHECK(shares[2].tasks == Tasks{1});
  CHECK(shares[1].tasks == Tasks{2});
  CHECK(shares[4].tasks == Tasks{2});
  CHECK(shares[3].tasks == Tasks{1});
  CHECK(shares[0].tasks == Tasks{1});
  CHECK(imbalance(units, shares, 2) == Approx(14 / 12.5));
  for (const StepShare& share : shares) CHECK_FALSE(share.in_parts);
}

TEST_CASE("images are cut where whole ones would leave a task with too much") {
  // Whole: 8 beside 1 + 1, which is 1.6 of the mean of 5. In parts of at most 5: 4 and 4.
  const auto units = units_of({8, 1, 1});
  const auto shares = share_out(units, 2, true);
  CHECK(shares[0].in_parts);
  CHECK(shares[0].tasks == Tasks{1, 2});
  CHECK(shares[1].tasks == Tasks{1});
  CHECK(shares[2].tasks == Tasks{2});
  CHECK_FALSE(shares[1].in_parts);
  CHECK(imbalance(units, shares, 2) == Approx(1));
  // There is nowhere to leave parts.
  CHECK(share_out(units, 2, false)[0].tasks == Tasks{1});
  // 1.25 times the mean is not too much: 5 beside 3.
  CHECK(share_out(units_of({5, 3}), 2, true)[0].tasks == Tasks{1});
}

TEST_CASE("one image for many tasks is cut into as many parts") {
  const auto shares = share_out(units_of({1000}), 7, true);
  CHECK(shares[0].tasks == Tasks{1, 2, 3, 4, 5, 6, 7});
}

TEST_CASE("the images of a model are parts, even whole ones") {
  std::vector<WorkUnit> units = units_of({4, 4});
  units[0].in_parts = units[1].in_parts = true;
  for (const StepShare& share : share_out(units, 2, true)) {
    CHECK(share.in_parts);
    CHECK(share.tasks.size() == 1);
  }
}

TEST_CASE("every piece of many images has one task, and no task has much more than another") {
  test::Random random(11);
  for (int round = 0; round < 200; ++round) {
    const std::uint32_t tasks = 1 + static_cast<std::uint32_t>(random.below(40));
    std::vector<double> costs(1 + random.below(60));
    for (double& cost : costs) cost = static_cast<double>(1 + random.below(20));  // 20-fold
    const auto units = units_of(costs);
    const auto shares = share_out(units, tasks, true);
    REQUIRE(shares.size() == units.size());
    for (const StepShare& share : shares) {
      REQUIRE_FALSE(share.tasks.empty());
      REQUIRE(share.in_parts == (share.tasks.size() > 1));
      for (const std::uint32_t task : share.tasks) REQUIRE((task >= 1 && task <= tasks));
    }
    CHECK(imbalance(units, shares, tasks) <= 1.25);
    // Another task, on another machine, works out the same.
    const auto again = share_out(units, tasks, true);
    for (std::size_t u = 0; u < units.size(); ++u) REQUIRE(again[u].tasks == shares[u].tasks);
  }
}

TEST_CASE("a block is in the part that its middle is in") {
  // 100 texels in two parts: the second begins at 50.
  CHECK(part_of(0, 10, 100, 2) == 0);
  CHECK(part_of(44, 10, 100, 2) == 0);  // middle 49
  CHECK(part_of(45, 10, 100, 2) == 1);  // middle 50
  CHECK(part_of(99, 1, 100, 2) == 1);
  CHECK(part_of(100, 0, 100, 2) == 1);  // nothing of it behind the last texel
  CHECK(part_of(0, 0, 0, 4) == 0);      // a page without texels
  CHECK(part_of(7, 3, 10, 1) == 0);
  // The largest page: 65536 x 65536 texels, a thousand parts.
  const std::uint64_t all = std::uint64_t{1} << 32;
  CHECK(part_of(all - 1, 1, all, 1000) == 999);
  CHECK(part_of(all / 2, 0, all, 1000) == 500);
}

TEST_CASE("what is missing is said with its tasks") {
  CHECK_NOTHROW(refuse_missing({}));
  try {
    refuse_missing({{"a.png", 3, 10, {7, 2}}, {"b.png", 0, 0, {2}}});
    FAIL("nothing was said");
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::busy);
    CHECK(std::string(e.what()) ==
          "a.png and 1 more: not all of it is there; run what is missing of tasks 2, 7 again");
  }
}
