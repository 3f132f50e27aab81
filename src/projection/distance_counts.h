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
  ++counts[static_cast<std::size_t>(std::clamp(bin, 0.0F, last))];
}

}  // namespace pounce::projection
