// SPDX-License-Identifier: Apache-2.0
//
// Catch2's main, and what Catch2 v2 lacks: skipped cases. ctest must not show as passed what never
// ran, so a run whose cases were all skipped ends with a status of its own (SKIP_RETURN_CODE in
// tests/CMakeLists.txt). A skipped case without [external] fails: it would hide among those that
// ran.
#define CATCH_CONFIG_RUNNER
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstddef>
#include <string>

#include "skip.h"

namespace {

constexpr int kSkipped = 77;  // as automake and ctest's users have it

std::size_t cases = 0, skipped = 0, hidden = 0;

struct CountSkipped : Catch::TestEventListenerBase {
  using TestEventListenerBase::TestEventListenerBase;
  void testCaseStarting(const Catch::TestCaseInfo& info) override {
    TestEventListenerBase::testCaseStarting(info);
    pounce::test::case_was_skipped = false;
  }
  void testCaseEnded(const Catch::TestCaseStats& stats) override {
    ++cases;
    if (!pounce::test::case_was_skipped) return;
    ++skipped;
    const auto& tags = stats.testInfo.lcaseTags;
    if (std::find(tags.begin(), tags.end(), "external") != tags.end()) return;
    ++hidden;
    std::printf("FAILED: \"%s\" was skipped, but its tags lack [external]\n",
                stats.testInfo.name.c_str());
  }
};
CATCH_REGISTER_LISTENER(CountSkipped)

}  // namespace

int main(int argc, char* argv[]) {
  const int failed = Catch::Session().run(argc, argv);
  if (failed != 0) return failed;
  if (hidden != 0) return 1;
  return cases != 0 && cases == skipped ? kSkipped : 0;
}
