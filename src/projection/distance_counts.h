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

/// The same distance in steps of max_distance / 2^16, of which sums do not depend on order, either.
inline std::uint64_t distance_steps(float distance, float max_distance) {
  constexpr float kSteps = 65536;
  return static_cast<std::uint64_t>(std::clamp(distance / max_distance, 0.0F, 1.0F) * kSteps +
                                    0.5F);
}

}  // namespace pounce::projection
