// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>

#include "job/run_job.h"
#include "pounce/error.h"

namespace pounce::job {
namespace {

constexpr std::uint64_t kMiB = 1U << 20;

MemoryLimit group(std::uint64_t mib) { return {mib * kMiB, 0, true, "the group (FILE)"}; }
MemoryLimit data(std::uint64_t mib, std::uint64_t taken_mib) {
  return {mib * kMiB, taken_mib * kMiB, false, "the data"};
}
/// A job whose least is 16 MiB of a budget, beside which the process takes 48 MiB.
ProcessNeed need(std::uint64_t held_mib = 0) {
  return {{16 * kMiB, "writing o.png"}, held_mib * kMiB, 48 * kMiB, 2};
}

std::string refusal(const std::vector<MemoryLimit>& limits, const ProcessNeed& of) {
  try {
    budget_under(limits, 1024 * kMiB, of);
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::budget);
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("what is in the budget already is not beside it", "[job]") {
  const std::uint64_t plain = beside_budget(40 * kMiB, 0, 2);
  CHECK(plain > 40 * kMiB);
  CHECK(beside_budget(100 * kMiB, 60 * kMiB, 2) == plain);
  CHECK(beside_budget(40 * kMiB, 0, 3) > plain);
  CHECK(beside_budget(0, 60 * kMiB, 2) == plain - 40 * kMiB);  // where the system says nothing
}

TEST_CASE("a budget is at most what a control group leaves", "[job]") {
  CHECK(budget_under({}, 512 * kMiB, need()).bytes == 512 * kMiB);
  CHECK(budget_under({group(1000)}, 512 * kMiB, need()).bytes == 512 * kMiB);
  CHECK(budget_under({group(1000)}, 512 * kMiB, need()).lowered_by.empty());
  CHECK(budget_under({group(100)}, 512 * kMiB, need()).bytes == 52 * kMiB);
  CHECK(budget_under({group(100)}, 512 * kMiB, need()).lowered_by == "the group (FILE)");
  CHECK(budget_under({group(64)}, 512 * kMiB, need()).bytes == 16 * kMiB);
  // It is less than the least where a user asked for less: that is another error.
  CHECK(budget_under({group(64)}, 8 * kMiB, need()).bytes == 8 * kMiB);
}

TEST_CASE("what does not hold the least is refused, with the need and the cure", "[job]") {
  CHECK(refusal({group(64)}, need()).empty());
  CHECK(refusal({group(63)}, need()) ==
        "the group (FILE) is 63.0 MiB: this job needs at least 64MiB, 16MiB of --memory for "
        "writing o.png and 48MiB for the program, its libraries and 2 threads; raise that limit "
        "to 64MiB");
  CHECK(!refusal({group(8)}, need()).empty());
}

TEST_CASE("a limit that only refuses memory is looked at, but lowers no budget", "[job]") {
  // 300 MiB are taken, 10 of them in the budget: 290 + 16.
  CHECK(refusal({data(306, 300)}, need(10)).empty());
  CHECK(budget_under({data(306, 300)}, 512 * kMiB, need(10)).bytes == 512 * kMiB);
  CHECK(refusal({data(305, 300)}, need(10)).find("needs at least 306MiB") != std::string::npos);
}

}  // namespace pounce::job
