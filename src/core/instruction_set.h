// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace pounce {

/// Whose kernels run: `asked`, or for "" what the environment variable POUNCE_ISA says, or without
/// it the best that this processor has. "sse2", "avx2" or "avx512". Throws Error(usage) if the
/// processor lacks what is asked for: a set that is named is never replaced by another.
std::string instruction_set(const std::string& asked = {});

}  // namespace pounce
