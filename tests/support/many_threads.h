// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/global_control.h>

namespace pounce::test {

/// A job starts no more threads than its process lets it. Tests of what must not depend on their
/// number let it have eight, on machines of fewer cores, too. Include it in such a test's file.
inline const tbb::global_control kEightThreads(tbb::global_control::max_allowed_parallelism, 8);

}  // namespace pounce::test
