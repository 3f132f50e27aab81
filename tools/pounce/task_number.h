// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace pounce::cli {

/// Which task of how many; `tasks` 0: not said.
struct TaskNumber {
  std::uint32_t task = 1, tasks = 0;
};

/// "3/20", "auto" or "auto/20": of auto, what the scheduler says in the environment. Throws
/// Error(usage), also where no scheduler says anything, or several do.
TaskNumber parse_task(const std::string& option, const std::string& text);

/// A whole number of tasks. Throws Error(usage).
std::uint32_t parse_count(const std::string& option, const std::string& text);

}  // namespace pounce::cli
