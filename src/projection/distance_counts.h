// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "pounce/report.h"

namespace pounce::projection {

/// Counts a texel that found its surface at `distance`, of at most `max_distance`. Integers, so the
/// sums do not depend on order.
inline void count_distance(float distance, float max_distance, DistanceCounts& counts) {
  const auto last = static_cast<float>(kDistanceBins - 1);
  const float bin = distance / max_distance * static_cast<float>(kDistanceBins);
  ++counts[bin > 0 ? static_cast<std::size_t>(std::min(bin, last)) : 0];
}

}  // namespace pounce::projection
