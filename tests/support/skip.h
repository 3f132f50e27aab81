// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>

namespace pounce::test {

/// Whether the test case that runs has been skipped; support/catch_main.cpp reads and clears it.
inline bool case_was_skipped = false;

/// A test case that cannot run here says what it needs and returns at once. Its tags hold
/// [external], so that ctest runs it apart from those that need nothing, and shows it as skipped.
inline void skip(const char* needs) {
  std::printf("SKIPPED: needs %s\n", needs);
  std::fflush(stdout);
  case_was_skipped = true;
}

}  // namespace pounce::test
