// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <csetjmp>

namespace pounce::io {

/// Runs a step of a C library that jumps out of its errors (longjmp) to `place`. False where it
/// did. Nothing below may have a destructor. Never inlined: what a jump comes back to must keep no
/// variable of the caller in a register.
template <class Step>
[[gnu::noinline]] bool attempt(std::jmp_buf& place, Step step) {
  if (setjmp(place) != 0) return false;
  step();
  return true;
}

}  // namespace pounce::io
