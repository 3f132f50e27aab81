// SPDX-License-Identifier: Apache-2.0
//
// A budget is what a job leases. The program and its libraries come on top, and whoever limits the
// process (a container, a scheduler, ulimit) limits the sum.
//
// Two kinds of limits, treated differently (docs/decisions/045-process-need.md). A control group
// kills without a message, so the budget is lowered until the sum fits, or the job is refused with
// the sum that would do. A ulimit refuses memory, which is an error like others: it ends a job
// beforehand only where it is certain to be hit.
#include "job/process_limits.h"

#include <fmt/format.h>

#include <algorithm>

namespace pounce::job {
namespace {

/// Of a thread beside what it leases: stack, the allocator's arena, the kernel's share.
constexpr std::uint64_t kThreadBytes = 1 << 20;
/// What libraries take later than this is measured, and pages that wait in the page pool.
constexpr std::uint64_t kMarginBytes = 8 << 20;

std::uint64_t mib_up(std::uint64_t bytes) { return (bytes + (1 << 20) - 1) >> 20; }

}  // namespace

std::uint64_t beside_budget(std::uint64_t anonymous_bytes, std::uint64_t held_bytes,
                            unsigned threads) {
  return anonymous_bytes - std::min(anonymous_bytes, held_bytes) + threads * kThreadBytes +
         kMarginBytes;
}

HeldBudget budget_under(const std::vector<MemoryLimit>& limits, std::uint64_t asked_bytes,
                        const ProcessNeed& need) {
  HeldBudget budget{asked_bytes, {}};
  for (const MemoryLimit& limit : limits) {
    // A limit that refuses is not reached before what is taken and leased is more than it.
    const std::uint64_t beside =
        limit.kills ? need.beside_bytes
                    : limit.taken_bytes - std::min(limit.taken_bytes, need.held_bytes);
    if (limit.bytes < need.least.bytes || limit.bytes - need.least.bytes < beside) {
      throw Error(
          ErrorKind::budget,
          fmt::format("{} is {}: this job needs at least {}MiB, {}MiB of --memory for {} "
                      "and {}MiB for the program, its libraries and {} threads; raise that "
                      "limit to {}MiB",
                      limit.name, runtime::format_bytes(limit.bytes),
                      mib_up(need.least.bytes + beside), mib_up(need.least.bytes), need.least.why,
                      mib_up(beside), need.threads, mib_up(need.least.bytes + beside)));
    }
    if (limit.kills && limit.bytes - beside < budget.bytes)
      budget = {limit.bytes - beside, limit.name};
  }
  return budget;
}

HeldBudget hold_to_limits(JobContext& job, const LeastMemory& least, std::uint64_t held_bytes) {
  // Measured, not assumed: libraries differ between machines. What planning holds already is part
  // of the budget's side and must not count twice.
  const std::uint64_t beside = beside_budget(anonymous_bytes(), held_bytes, job.threads);
  job.report.memory_beside_bytes = beside;
  const std::vector<MemoryLimit> limits = memory_limits();
  HeldBudget budget =
      budget_under(limits, job.asked_bytes, {least, held_bytes, beside, job.threads});
  job.budget.set_limit(budget.bytes);
  for (const MemoryLimit& limit : limits) {
    if (limit.kills) job.room_bytes = limit.bytes - beside;
  }
  return budget;
}

}  // namespace pounce::job
