// SPDX-License-Identifier: Apache-2.0
#include "core/instruction_set.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "pounce/error.h"

namespace pounce {
namespace {

constexpr const char* kVariable = "POUNCE_ISA";

/// What this processor has, the best one last.
std::vector<std::string> available_sets() {
  std::vector<std::string> sets{"sse2"};
  if (__builtin_cpu_supports("avx2") == 0 || __builtin_cpu_supports("fma") == 0) return sets;
  sets.emplace_back("avx2");
  if (__builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
      __builtin_cpu_supports("avx512vl") != 0 && __builtin_cpu_supports("avx512bw") != 0)
    sets.emplace_back("avx512");
  return sets;
}

}  // namespace

std::string instruction_set(const std::string& asked) {
  const std::vector<std::string> sets = available_sets();
  const char* const variable = asked.empty() ? std::getenv(kVariable) : nullptr;
  const std::string wanted = variable != nullptr ? variable : asked;
  if (wanted.empty()) return sets.back();
  if (std::find(sets.begin(), sets.end(), wanted) != sets.end()) return wanted;
  throw Error(ErrorKind::usage, fmt::format("{}: got \"{}\"; this processor can run {}",
                                            variable != nullptr ? kVariable : "instruction set",
                                            wanted, fmt::join(sets, ", ")));
}

}  // namespace pounce
