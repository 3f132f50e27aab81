// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "surface/target_block.h"

namespace pounce::projection {

/// The angle between a texel's normal and its further rays is 35 degrees (docs/decisions/
/// 027-rays.md).
inline constexpr double kConeCosine = 0.81915204428899178968, kConeSine = 0.57357643635104609611;

/// The packet as it looks along further ray `k` of `count`: the same points, each with its normal
/// tilted by the cone's angle. The rays of a texel lie evenly around its normal. Lanes without a
/// normal stay without. 0 <= k < count. The same bits on every machine.
surface::TexelPacket tilted(const surface::TexelPacket& packet, int k, int count);

}  // namespace pounce::projection
