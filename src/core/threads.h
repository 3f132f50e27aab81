// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pounce {

/// How many threads of `wanted`, the calling one included, this process may have at once. They are
/// started and ended again: what a thread pool does when it gets fewer than it counts on is not for
/// us to say.
unsigned obtainable_threads(unsigned wanted);

}  // namespace pounce
